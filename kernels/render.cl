/* render.cl: the renderer's per-ray mathematics: low-discrepancy points, sampling and evaluation of all
 * lobes of a surface, and the filter that removes what noise is left.
 *
 * Random numbers are Owen-scrambled points of Sobol's (0, 2)-sequence by hashing (Burley 2020): every
 * aligned block of 2^m consecutive indices is stratified in both dimensions, so pixels that take
 * neighbouring blocks complete each other (interleaved sampling, Keller and Heidrich 2001).
 *
 * A ray's five weights are the integrands of (X, Y, A, B, coat) of reflectance.cl.  With the build constant PHONG they are
 * (0, X, A, 0, 0) of the phong model, which F90 = 0 turns into k_d X + k_s A.
 */
#include "reflectance.cl"
#include "visible_normals.cl"

#ifndef BLOCK
#define BLOCK 4 /* bins on a side that are taken together */
#endif
#define BLOCKS (SIDE / BLOCK) /* on a side */
#ifndef PHONG
#define PHONG 0
#endif
#define WEIGHTS 5
#define MIN_ALPHA 4e-4f /* sharper lobes drown in the rounding of half vectors */

inline uint reverse_bits(uint x)
{
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
    x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
    return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

inline uint hash(uint x)
{
    x ^= x >> 16; x *= 0x7feb352du; x ^= x >> 15; x *= 0x846ca68bu; x ^= x >> 16;
    return x;
}

/* Owen's scrambling: each bit is flipped by a hash of the bits above it.  Laine and Karras 2011, Burley 2020 */
inline uint scramble(uint x, uint seed)
{
    x = reverse_bits(x);
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return reverse_bits(x);
}

/* point `index` of the sequence `seed` in [0, 1)^2 */
inline float2 sobol(uint index, uint seed)
{
    uint s = hash(seed + 1u);
    index = scramble(index, s);
    uint y = 0u;
    uint i = index;
    for (uint v = 1u << 31; i != 0u; i >>= 1, v ^= v >> 1)
        if (i & 1u) y ^= v;
    uint x = scramble(reverse_bits(index), hash(s ^ 0x68bc21ebu));
    y = scramble(y, hash(s ^ 0x02e5be93u));
    return (float2)((float)(x >> 8), (float)(y >> 8)) * 0x1p-24f;
}

/* points (n, 2) of a sequence at given indices */
__kernel void sequence_points(
    const uint n,                  /* points */
    const uint seed,               /* which sequence */
    __global const uint *index,    /* (n) */
    __global float *point)         /* (n, 2) out */
{
    size_t i = get_global_id(0);
    if (i >= n) return;
    vstore2(sobol(index[i], seed), i, point);
}

/* of phong: the exponent (phong_exponent of usdslf/surfaces/reflectance.py), and the density of cos^n about the mirrored eye */
inline float exponent_of(float alpha) { return clamp(0.5f / (alpha * alpha) - 0.5f, 1e-3f, 1e6f); }

inline float phong_pdf(float n, float3 e, float3 l)
{
    return (n + 1.0f) / (2.0f * PI_F) * pow(max(e.z * l.z - e.x * l.x - e.y * l.y, 0.0f), n);
}

inline float3 phong_direction(float n, float3 e, float2 u)
{
    float c = pow(1.0f - u.y, 1.0f / (n + 1.0f)), s = sqrt(max(1.0f - c * c, 0.0f)), phi = 2.0f * PI_F * u.x;
    float3 m = (float3)(-e.x, -e.y, e.z), t, b;
    frame_about(m, &t, &b);
    return s * cos(phi) * t + s * sin(phi) * b + c * m;
}

/* weights (5) of light direction l seen from e, and the density of the mixture of lobes that draws it.
 * lobes: alpha, alpha of the coat, chance of the specular lobe, chance of the coat; coat: its strength, its F0.
 * h: half vector. */
inline float lobe_weights(float4 lobes, float2 coat, float3 e, float3 l, float3 h, float *w)
{
    float nl = l.z, ne = e.z;
    for (int i = 0; i < WEIGHTS; i++) w[i] = 0.0f;
    if (nl <= 0.0f) return 0.0f;
    float eh = clamp(dot(e, h), 0.0f, 1.0f);
    float f = pown(1.0f - eh, 5);
    float d = ggx_of_half(lobes.x, h);
    float c = nl / PI_F;
#if PHONG
    float n = exponent_of(lobes.x);
    float4 column = phong_columns(n, e, l);
    w[1] = column.x;
    w[2] = column.z;
    float lobe_pdf = phong_pdf(n, e, l);
#else
    float lobe_pdf = visible_pdf(lobes.x, d, ne);
    float dvc = d * smith_visibility(lobes.x, nl, ne) * nl;
    w[0] = (1.0f - f) * c;
    w[1] = f * c;
    w[2] = (1.0f - f) * dvc;
    w[3] = f * dvc;
#endif
    float pdf = (1.0f - lobes.z - lobes.w) * c + lobes.z * lobe_pdf;
    if (coat.x > 0.0f) {
        float dc = ggx_of_half(lobes.y, h);
        w[4] = coat.x * (coat.y + (1.0f - coat.y) * f) * dc * smith_visibility(lobes.y, nl, ne) * nl;
        pdf += lobes.w * visible_pdf(lobes.y, dc, ne);
    }
    return pdf;
}

/* ── guided directions: see usdslf/render/guide.py.  A guide's row holds cumulative chances of its blocks ── */

inline float guide_density(__global const float *row, __global const float *frames, int element, float3 d)
{
    float3 l = local_from_world(frames, element, d);
    if (l.z <= 0.0f) return 0.0f;
    int bin = bin_of(l);
    int b = bin / SIDE / BLOCK * BLOCKS + bin % SIDE / BLOCK;
    float chance = row[b] - (b > 0 ? row[b - 1] : 0.0f);
    return chance * (BLOCKS * BLOCKS) / (2.0f * PI_F);
}

inline float3 guided_direction(__global const float *row, __global const float *frames, int element, float2 u)
{
    int low = 0, high = BLOCKS * BLOCKS - 1; /* the first block whose cumulative chance exceeds u.x */
    while (low < high) {
        int middle = (low + high) / 2;
        if (row[middle] > u.x) high = middle; else low = middle + 1;
    }
    float before = low > 0 ? row[low - 1] : 0.0f;
    float x = clamp((u.x - before) / max(row[low] - before, 1e-12f), 0.0f, 0.9999999f);
    float2 q = ((float2)(low % BLOCKS + x, low / BLOCKS + u.y)) * (2.0f / BLOCKS) - 1.0f;
    return world_from_local(frames, element, hemisphere_from_square(q.x, q.y));
}

/* luminance times cosine that arrives at each block of an element: from surfaces, their own emission left out (it is
 * sampled as light); the cosine-weighted share of the block that escapes; and all of the light */
__kernel void guiding_light(
    const uint count,                 /* N * blocks */
    __global const uint *hit,         /* (N, D) element << 10 | bin */
    __global const float *mean,       /* (N, D / BLOCK^2, 3) outgoing, of average_bins */
    __global const float *fixed,      /* (N, D, 3) light that arrives from lights and domes */
    __global const float *emitted,    /* (N) luminance */
    __global float *light)            /* (N, blocks, 3) out */
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t element = i / (BLOCKS * BLOCKS);
    uint b = i % (BLOCKS * BLOCKS);
    float sum = 0.0f, open = 0.0f, all = 0.0f;
    const float3 luminance = (float3)(0.2126f, 0.7152f, 0.0722f);
    for (uint y = 0; y < BLOCK; y++)
        for (uint x = 0; x < BLOCK; x++) {
            int d = (b / BLOCKS * BLOCK + y) * SIDE + b % BLOCKS * BLOCK + x;
            float r = max(fabs((float)(d % SIDE) - 0.5f * (SIDE - 1)), fabs((float)(d / SIDE) - 0.5f * (SIDE - 1))) * (2.0f / SIDE);
            float z = 1.0f - r * r; /* of bin_direction(d) */
            uint h = hit[element * D_BINS + d];
            all += dot(load3(fixed, element * D_BINS + d), luminance) * z;
            if (h == ESCAPES) open += z;
            if (h >= BLOCKED) continue;
            uint bin = h % D_BINS;
            uint to = bin / SIDE / BLOCK * BLOCKS + bin % SIDE / BLOCK;
            float l = dot(load3(mean, (size_t)(h / D_BINS) * (BLOCKS * BLOCKS) + to), luminance);
            sum += max(l - emitted[h / D_BINS], 0.0f) * z;
            all += l * z;
        }
    store3((float3)(sum, open, all), light, i);
}

/* eye in the frame (t, b, n), kept above the horizon */
inline float3 local_eye(float3 t, float3 b, float3 n, float3 v)
{
    float3 e = (float3)(dot(t, v), dot(b, v), max(dot(n, v), 1e-3f));
    return normalize(e);
}

/* density of the mixture when the share g of its cosine lobe is drawn from a guide */
inline float with_guide(float pdf, float4 lobes, float nl, float g, int element, __global const float *guides,
                        __global const float *frames, float3 d)
{
    if (g <= 0.0f || nl <= 0.0f) return pdf;
    float wide = (1.0f - lobes.z - lobes.w) * g;
    float guide = guide_density(guides + (size_t)element * (BLOCKS * BLOCKS), frames, element, d);
    return pdf + wide * (guide - nl / PI_F);
}

/* draws k directions at each of n points from the mixture of their lobes */
__kernel void sample_lobes(
    const uint n,                   /* points */
    const uint k,                   /* directions of each point */
    const uint seed,                /* sequence */
    __global const uint *index,     /* (n) first index of each point in the sequence; it takes k of them */
    __global const float *normal,   /* (n, 3) */
    __global const float *view,     /* (n, 3) towards the viewer */
    __global const float *lobes,    /* (n, 4) alpha, coat alpha, chance of specular, chance of coat */
    __global const float *coat,     /* (n, 2) strength, F0 */
    __global const int *element,    /* (n) whose guide is used; negative: none */
    __global const float *guides,   /* (N, blocks) */
    __global const float *frames,   /* (N, 3, 3) of elements */
    const float guided,             /* share of the rays of wide lobes */
    __global float *direction,      /* (n, k, 3) out: world */
    __global float *pdf,            /* (n, k) out: 1/sr; 0 where below the horizon */
    __global float *lobe_pdf,       /* (n, k) out: the same without the guide */
    __global float *weight)         /* (n, k, 5) out: integrands over pdf */
{
    size_t i = get_global_id(0);
    if (i >= (size_t)n * k) return;
    size_t p = i / k;
    float3 nn = load3(normal, p), t, b;
    frame_about(nn, &t, &b);
    float3 e = local_eye(t, b, nn, load3(view, p));
    float4 lob = vload4(p, lobes);
    float2 u = sobol(index[p] + (uint)(i % k), seed);
    int e_ = element[p];
    float g = e_ < 0 ? 0.0f : guided;
    float3 l, h;
    float first = lob.z, second = lob.z + lob.w;
    if (u.x < second) {
        int spec = u.x < first;
        u.x = spec ? u.x / first : (u.x - first) / lob.w;
#if PHONG
        l = phong_direction(exponent_of(lob.x), e, u);
        h = normalize(e + l);
#else
        h = visible_normal(spec ? lob.x : lob.y, e, u);
        l = 2.0f * dot(e, h) * h - e;
#endif
    } else {
        u.x = min((u.x - second) / (1.0f - second), 0.99999994f);
        if (u.x < g) {
            float3 d = guided_direction(guides + (size_t)e_ * (BLOCKS * BLOCKS), frames, e_, (float2)(u.x / g, u.y));
            l = (float3)(dot(t, d), dot(b, d), dot(nn, d));
        } else {
            u.x = min((u.x - g) / (1.0f - g), 0.99999994f);
            float r = sqrt(u.y), phi = 2.0f * PI_F * u.x;
            l = (float3)(r * cos(phi), r * sin(phi), sqrt(max(1.0f - u.y, 0.0f)));
        }
        h = normalize(e + l);
    }
    float w[WEIGHTS];
    float3 world = normalize(l.x * t + l.y * b + l.z * nn);
    store3(world, direction, i);
    lobe_pdf[i] = lobe_weights(lob, vload2(p, coat), e, l, h, w);
    float q = with_guide(lobe_pdf[i], lob, l.z, g, e_, guides, frames, world);
    pdf[i] = q;
    float scale = q > 0.0f ? 1.0f / q : 0.0f;
    for (int c = 0; c < WEIGHTS; c++) weight[i * WEIGHTS + c] = w[c] * scale;
}

/* weights and density of given directions, one for each of n points */
__kernel void evaluate_lobes(
    const uint n,                   /* points */
    __global const float *normal,   /* (n, 3) */
    __global const float *view,     /* (n, 3) */
    __global const float *lobes,    /* (n, 4) */
    __global const float *coat,     /* (n, 2) */
    __global const int *element,    /* (n) */
    __global const float *guides,   /* (N, blocks) */
    __global const float *frames,   /* (N, 3, 3) */
    const float guided,
    __global const float *direction, /* (n, 3) towards the light */
    __global float *pdf,            /* (n) out */
    __global float *weight)         /* (n, 5) out: integrands */
{
    size_t i = get_global_id(0);
    if (i >= n) return;
    float3 nn = load3(normal, i), t, b;
    frame_about(nn, &t, &b);
    float3 e = local_eye(t, b, nn, load3(view, i));
    float3 d = load3(direction, i);
    float3 l = (float3)(dot(t, d), dot(b, d), dot(nn, d));
    float w[WEIGHTS];
    float4 lob = vload4(i, lobes);
    float q = lobe_weights(lob, vload2(i, coat), e, l, normalize(e + l), w);
    pdf[i] = with_guide(q, lob, l.z, element[i] < 0 ? 0.0f : guided, element[i], guides, frames, d);
    for (int c = 0; c < WEIGHTS; c++) weight[i * WEIGHTS + c] = w[c];
}

/* ── the light field for wide rays: see usdslf/render/wide_field.py ── */
__kernel void average_bins(
    const uint count,                 /* N * blocks */
    __global const float *outgoing,   /* (N, D, 3) */
    __global float *mean)             /* (N, D / BLOCK^2, 3) out */
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t element = i / (BLOCKS * BLOCKS);
    uint b = i % (BLOCKS * BLOCKS);
    float3 sum = (float3)(0.0f);
    for (uint y = 0; y < BLOCK; y++)
        for (uint x = 0; x < BLOCK; x++)
            sum += load3(outgoing, element * D_BINS + (b / BLOCKS * BLOCK + y) * SIDE + b % BLOCKS * BLOCK + x);
    store3(sum / (float)(BLOCK * BLOCK), mean, i);
}

__kernel void follow_wide_links(
    const uint n,                   /* hits */
    const uint near,                /* links of each */
    __global const uint *links,     /* (n, near) element << 10 | bin */
    __global const float *weights,  /* (n, near) */
    __global const float *mean,     /* (N, D / BLOCK^2, 3) */
    __global float *radiance)       /* (n, 4) out: interpolated, and the luminance of the brightest element */
{
    uint i = get_global_id(0);
    if (i >= n) return;
    float3 v = (float3)(0.0f);
    float brightest = 0.0f;
    for (uint k = 0; k < near; k++) {
        uint h = links[i * near + k];
        if (h >= BLOCKED) continue;
        uint bin = h % D_BINS;
        uint b = bin / SIDE / BLOCK * BLOCKS + bin % SIDE / BLOCK;
        float3 one = load3(mean, (size_t)(h / D_BINS) * (BLOCKS * BLOCKS) + b);
        float weight = weights[i * near + k];
        v += weight * one;
        if (weight > 0.02f) brightest = max(brightest, dot(one, (float3)(0.2126f, 0.7152f, 0.0722f)));
    }
    vstore4((float4)(v, brightest), i, radiance);
}

/* ── the filter ──
 *
 * Filters demodulated illumination over a window of the picture's samples and gives it back its colours.
 *
 * In a window of the size of the interleaving tile every sample of the set occurs once, so a box is the right
 * shape: flat areas come out without any noise.  A neighbour counts where it shows the same material, lies in
 * the same plane and looks the same way; for specular light, where its mirror direction differs by less
 * than the lobe is wide, so that sharp reflections stay sharp.  Where that is less than the window, a part of the tile
 * would be left out, and the place in the tile would show as a pattern: there the tile is smaller, and so is the window.
 *
 * features (15): plane position 3, normal 3, mirror direction 3, alpha, tolerance of the plane, class (negative: empty),
 * weight (rays that were sent), samples on a side of the tile for specular light, how far mirror directions may differ
 * Illumination has COLUMNS columns of three: X, Y, A, B, coat.
 */
#define FEATURES 15
#define COLUMNS 5

/* of a sample b that lies (u, v) samples away from a.  0: another surface; 1: diffuse light may be shared; 2: specular light too */
inline int shared_light(__global const float *a, __global const float *b, const int u, const int v,
                        const float normal_cosine)
{
    if (a == b) return 2;
    float3 n = vload3(1, a);
    if (b[11] != a[11] || fabs(dot(vload3(0, b) - vload3(0, a), n)) > a[10] || dot(vload3(1, b), n) < normal_cosine)
        return 0;
    int side = (int)a[13], before = side / 2;
    if (min(u, v) < -before || max(u, v) >= side - before) return 1;
    float3 off = vload3(2, b) - vload3(2, a);
    return dot(off, off) > a[14] * a[14] || fabs(b[9] - a[9]) > 0.15f * a[9] ? 1 : 2;
}

__kernel void filter_light(
    const int width, const int height,  /* of the picture in samples */
    const int window,                   /* samples on a side */
    const float normal_cosine,          /* how far normals may differ */
    __global const float *features,     /* (height, width, 15) */
    __global const float *colors,       /* (height, width, 9) d, F0, F90 */
    __global const float *light,        /* (height, width, 15) X, Y, A, B, coat */
    __global float *radiance)           /* (height, width, 3) out */
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height) return;
    size_t p = (size_t)y * width + x;
    __global const float *a = features + p * FEATURES;
    if (a[11] < 0.0f) {
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
            float w = b[12];
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
    __global const float *features,     /* (height, width, 15) */
    __global const uint *quarter,       /* (height, width) of its tile, in which each sample lies */
    __global const float *value,        /* (height, width, 2) luminance of diffuse and of specular light */
    __global float *noise)              /* (height, width, 3) out: mean, variance of the mean, samples of specular light */
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height) return;
    size_t p = (size_t)y * width + x;
    __global const float *a = features + p * FEATURES;
    if (a[11] < 0.0f) {
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
        float side = g == 0 ? (float)window : min((float)window, a[13]);
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
