/* filter.cl: takes the noise that is left out of gathered light.
 *
 * Filters demodulated illumination over a window of the picture's samples and gives it back its colours.
 *
 * In a window of the size of the interleaving tile every sample of the set occurs once, so a box is the right
 * shape: flat areas come out without any noise.  A neighbour counts where it shows the same material, lies in
 * the same plane and looks the same way; for specular light, where its mirror direction differs by less
 * than the lobe is wide, so that sharp reflections stay sharp.  Where that is less than the window, a part of the tile
 * would be left out, and the place in the tile would show as a pattern: there the tile is smaller, and so is the window.
 *
 * Build constants, of usdslf/render/filter.py: FEATURES of a sample, and where in them stand POSITION, NORMAL, MIRROR (its
 * mirror direction), ALPHA, PLANE_GAP (how far neighbours may lie off its plane), CLASS (negative: empty), WEIGHT (rays that
 * were sent), TILE (samples on a side of the tile for specular light) and LOBE_WIDTH (how far mirror directions may differ).
 * Illumination has COLUMNS columns of three: X, Y, A, B, coat.
 */
#include "common.cl"

#define COLUMNS 5

/* of a sample b that lies (u, v) samples away from a.  0: another surface; 1: diffuse light may be shared; 2: specular light too */
inline int shared_light(__global const float *a, __global const float *b, const int u, const int v,
                        const float normal_cosine)
{
    if (a == b) return 2;
    float3 n = vload3(0, a + NORMAL);
    if (b[CLASS] != a[CLASS] || dot(vload3(0, b + NORMAL), n) < normal_cosine) return 0;
    if (fabs(dot(vload3(0, b + POSITION) - vload3(0, a + POSITION), n)) > a[PLANE_GAP]) return 0;
    int side = (int)a[TILE], before = side / 2;
    if (min(u, v) < -before || max(u, v) >= side - before) return 1;
    float3 off = vload3(0, b + MIRROR) - vload3(0, a + MIRROR);
    return dot(off, off) > a[LOBE_WIDTH] * a[LOBE_WIDTH] || fabs(b[ALPHA] - a[ALPHA]) > 0.15f * a[ALPHA] ? 1 : 2;
}

__kernel void filter_light(
    const int width, const int height,  /* of the picture in samples */
    const int window,                   /* samples on a side */
    const float normal_cosine,          /* how far normals may differ */
    __global const float *features,     /* (height, width, FEATURES) */
    __global const float *colors,       /* (height, width, 9) d, F0, F90 */
    __global const float *light,        /* (height, width, 15) X, Y, A, B, coat */
    __global float *radiance)           /* (height, width, 3) out */
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height) return;
    size_t p = (size_t)y * width + x;
    __global const float *a = features + p * FEATURES;
    if (a[CLASS] < 0.0f) {
        store3((float3)(0.0f), radiance, p);
        return;
    }
    float diffuse_weight = 0.0f, specular_weight = 0.0f;
    float3 s[COLUMNS];
    for (int c = 0; c < COLUMNS; c++) s[c] = (float3)(0.0f);
    int x0 = max(x - window / 2, 0), x1 = min(x - window / 2 + window - 1, width - 1);
    int y0 = max(y - window / 2, 0), y1 = min(y - window / 2 + window - 1, height - 1);
    for (int v = y0; v <= y1; v++)
        for (int u = x0; u <= x1; u++) {
            size_t q = (size_t)v * width + u;
            __global const float *b = features + q * FEATURES;
            int share = shared_light(a, b, u - x, v - y, normal_cosine);
            if (share == 0) continue;
            __global const float *l = light + q * (3 * COLUMNS);
            float w = b[WEIGHT];
            s[0] += w * vload3(0, l);
            s[1] += w * vload3(1, l);
            diffuse_weight += w;
            if (share == 1) continue;
            for (int c = 2; c < COLUMNS; c++) s[c] += w * vload3(c, l);
            specular_weight += w;
        }
    float i = 1.0f / diffuse_weight, j = 1.0f / specular_weight;
    float3 d = load3(colors, 3 * p), f0 = load3(colors, 3 * p + 1), f90 = load3(colors, 3 * p + 2);
    float3 matte = d * ((1.0f - f0) * s[0] + (1.0f - f90) * s[1]);
    store3(i * matte + j * (f0 * s[2] + f90 * s[3] + s[4]), radiance, p);
}

/* how uncertain the filtered light is: for the means of `value` over the window the variance, from how much the quarters of
 * the tile disagree (each is a low-discrepancy set of its own), or from all samples where quarters are missing */
__kernel void window_noise(
    const int width, const int height,
    const int window,
    const float normal_cosine,
    __global const float *features,     /* (height, width, FEATURES) */
    __global const uint *quarter,       /* (height, width) of its tile, in which each sample lies */
    __global const float *value,        /* (height, width, 2) luminance of diffuse and of specular light */
    __global float *noise)              /* (height, width, 3) out: mean, variance of the mean, samples of specular light */
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height) return;
    size_t p = (size_t)y * width + x;
    __global const float *a = features + p * FEATURES;
    if (a[CLASS] < 0.0f) {
        store3((float3)(0.0f), noise, p);
        return;
    }
    float sum[2][4], count[2][4], square[2] = {0.0f, 0.0f};
    for (int g = 0; g < 2; g++)
        for (int k = 0; k < 4; k++) sum[g][k] = count[g][k] = 0.0f;
    int x0 = max(x - window / 2, 0), x1 = min(x - window / 2 + window - 1, width - 1);
    int y0 = max(y - window / 2, 0), y1 = min(y - window / 2 + window - 1, height - 1);
    for (int v = y0; v <= y1; v++)
        for (int u = x0; u <= x1; u++) {
            size_t q = (size_t)v * width + u;
            int share = shared_light(a, features + q * FEATURES, u - x, v - y, normal_cosine);
            uint k = quarter[q];
            for (int g = 0; g < share; g++) {
                float l = value[2 * q + g];
                sum[g][k] += l;
                square[g] += l * l;
                count[g][k] += 1.0f;
            }
        }
    float total = 0.0f, variance = 0.0f, n = 0.0f;
    for (int g = 0; g < 2; g++) {
        n = count[g][0] + count[g][1] + count[g][2] + count[g][3];
        float mean = (sum[g][0] + sum[g][1] + sum[g][2] + sum[g][3]) / n;
        float least = min(min(count[g][0], count[g][1]), min(count[g][2], count[g][3]));
        float naive = max(square[g] / n - mean * mean, 0.0f) / max(n - 1.0f, 1.0f);
        float side = g == 0 ? (float)window : min((float)window, a[TILE]);
        if (least >= 0.125f * side * side) {
            float apart = 0.0f;
            for (int k = 0; k < 4; k++) {
                float off = sum[g][k] / count[g][k] - mean;
                apart += off * off;
            }
            naive = min(naive, apart / 12.0f);
        }
        total += mean;
        variance += naive;
    }
    store3((float3)(total, variance, n), noise, p);
}
