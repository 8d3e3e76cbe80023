/* evidence.cl: the columns that each roughness makes of the light that arrives at painted samples (sample_rays.cl).
 */
#include "reflectance.cl"
#include "links.cl"

/* what no level changes of the lobe: its integrand is of these and of the level's parameter; of phong `near` is the cosine about the
 * mirrored eye */
typedef struct {
    float16 near, rest, nl;
} Sides;

inline Sides sides_of(float3 e, float16 lx, float16 ly, float16 lz, float16 *ramp)
{
    Sides o;
    float16 zero = 0.0f, one = 1.0f;
    o.nl = lz > zero ? lz : zero;
    float16 hx = e.x + lx, hy = e.y + ly, hz = e.z + lz, square = hx * hx + hy * hy + hz * hz, tiny = 1e-20f;
    float16 s = one / sqrt(square > tiny ? square : tiny);
    float16 h = (e.x * hx + e.y * hy + e.z * hz) * s, z = hz * s;
    h = h > zero ? h : zero;
    z = z > zero ? z : zero;
    h = h < one ? h : one;
    z = z < one ? z : one;
    float16 g = one - h, g2 = g * g;
    *ramp = HAS_FRESNEL ? g2 * g2 * g : zero;
#if MODEL == 0
    o.near = z * z;
    o.rest = (one - z) * (one + z);
#else
    float16 m = e.z * lz - e.x * lx - e.y * ly;
    o.near = m > zero ? m : zero;
    o.rest = zero;
#endif
    return o;
}

/* the lobe times the cosine */
inline float16 lobe_of_sides(float parameter, float ne, Sides o)
{
#if MODEL == 0
    float a2 = parameter * parameter, le = sqrt(a2 + (1.0f - a2) * ne * ne);
    float16 t = o.near * a2 + o.rest, ll = sqrt(a2 + (1.0f - a2) * o.nl * o.nl), v = o.nl * le + ne * ll, tiny = 1e-9f;
    return (0.5f / PI_F * a2) * o.nl / (t * t * (v > tiny ? v : tiny));
#else
    return (parameter + 2.0f) / (2.0f * PI_F) * pow(o.near, parameter) * o.nl;
#endif
}

inline float sum16(float16 v)
{
    float8 a = v.lo + v.hi;
    float4 b = a.lo + a.hi;
    return b.x + b.y + b.z + b.w;
}

#define PACKS 4 /* that are looked at together on all levels */

/* the columns of each sample at each of its levels, one work-item a sample, sixteen rays at a time
 * eye        (S, 3) local
 * light_row  (S) row of `towards` and `light` that the sample sees
 * towards    (R, 3, K / 16) float16, local
 * light      (R, 3, K / 16) float16, radiance over density; zero where K is filled up
 * parameters (S, J) alpha, or the Phong exponent
 * columns    (S, J, 4, 3): result
 */
__kernel void columns(__global const float *eye, __global const int *light_row, __global const float16 *towards,
                      __global const float16 *light, __global const float *parameters, const uint packs, const uint levels,
                      const uint samples, __global float *columns)
{
    uint s = get_global_id(0);
    if (s >= samples) return;
    float3 e = load3(eye, s);
    float ne = e.z > 1e-4f ? e.z : 1e-4f;
    __global const float16 *to = towards + (size_t)light_row[s] * 3 * packs;
    __global const float16 *radiance = light + (size_t)light_row[s] * 3 * packs;
    __global float *out = columns + (size_t)s * levels * 12;
    float16 x[3], y[3];
    for (int c = 0; c < 3; c++) x[c] = y[c] = 0.0f;
    for (uint first = 0; first < packs; first += PACKS) {
        uint count = packs - first < PACKS ? packs - first : PACKS;
        Sides sides[PACKS];
        float16 flat[PACKS][3], steep[PACKS][3];
        for (uint i = 0; i < count; i++) {
            uint at = first + i;
            float16 f;
            sides[i] = sides_of(e, to[at], to[packs + at], to[2 * packs + at], &f);
            for (int c = 0; c < 3; c++) {
                float16 r = radiance[c * packs + at];
                flat[i][c] = (1.0f - f) * r;
                steep[i][c] = f * r;
                x[c] += sides[i].nl * flat[i][c];
                y[c] += sides[i].nl * steep[i][c];
            }
        }
        for (uint j = 0; j < levels; j++) {
            float16 a[3], b[3];
            for (int c = 0; c < 3; c++) a[c] = b[c] = 0.0f;
            for (uint i = 0; i < count; i++) {
                float16 w = lobe_of_sides(parameters[s * levels + j], ne, sides[i]);
                for (int c = 0; c < 3; c++) {
                    a[c] += w * flat[i][c];
                    b[c] += w * steep[i][c];
                }
            }
            for (int c = 0; c < 3; c++) {
                out[j * 12 + 6 + c] = (first ? out[j * 12 + 6 + c] : 0.0f) + sum16(a[c]);
                out[j * 12 + 9 + c] = (first ? out[j * 12 + 9 + c] : 0.0f) + sum16(b[c]);
            }
        }
    }
    for (int c = 0; c < 3; c++) {
        float of_x = sum16(x[c]) / PI_F, of_y = sum16(y[c]) / PI_F;
        for (uint j = 0; j < levels; j++) {
            out[j * 12 + c] = of_x;
            out[j * 12 + 3 + c] = of_y;
        }
    }
}

#define TOGETHER 16 /* samples that are summed before their sum is added to that of the others: many small numbers lose less */

/* what dabs make of their samples, one work-item a dab and level: reflectance.py's `bilinear`, and means over the dab
 * first    (n + 1) first sample of each dab, and behind those of the last
 * columns  (S, J, 4, 3)
 * d, f0, f90 (S, 3)
 * tied     F90 changes with F0
 * count    n * J
 * means    (n, J, 7, 3): result: P, U, V, W, d U, d W, F0 V
 * own      (S, 3): result, of the dabs' samples: P at the last level
 */
__kernel void means_of_dabs(__global const int *first, __global const float *columns, __global const float *d,
                            __global const float *f0, __global const float *f90, const int tied, const uint levels,
                            const uint count, __global float *means, __global float *own)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    uint dab = i / levels, level = i % levels;
    int begin = first[dab], end = first[dab + 1];
    float3 sum[7];
    for (int k = 0; k < 7; k++) sum[k] = 0.0f;
    for (int from = begin; from < end; from += TOGETHER) {
        float3 part[7];
        for (int k = 0; k < 7; k++) part[k] = 0.0f;
        int to = from + TOGETHER < end ? from + TOGETHER : end;
        for (int s = from; s < to; s++) {
            __global const float *of = columns + ((size_t)s * levels + level) * 12;
            float3 x = load3(of, 0), y = load3(of, 1), a = load3(of, 2), b = load3(of, 3);
            float3 kd = load3(d, s), ks = load3(f0, s), kg = load3(f90, s), p, u, v, w;
#if MODEL == 0
            u = (1.0f - ks) * x + (1.0f - kg) * y;
            p = kd * u + ks * a + kg * b;
            w = tied ? x + y : x;
            v = (tied ? a + b : a) - kd * w;
#else
            u = x;
            p = kd * x + ks * a;
            w = 0.0f;
            v = a;
#endif
            part[0] += p; part[1] += u; part[2] += v; part[3] += w;
            part[4] += kd * u; part[5] += kd * w; part[6] += ks * v;
            if (level + 1 == levels) store3(p, own, s);
        }
        for (int k = 0; k < 7; k++) sum[k] += part[k];
    }
    float scale = end > begin ? 1.0f / (end - begin) : 0.0f;
    for (int k = 0; k < 7; k++) store3(scale * sum[k], means, (size_t)i * 7 + k);
}

/* radiance over density of all rays and lights, with what surfaces send now
 * fixed (S, 3, row), gain (S * rays, 3), links, weights (S * rays, 4): of sample_rays.cl
 * outgoing (N, D, 3); light (S, 3, row): result
 */
__kernel void add_arriving(
    const uint count, const uint rays, const uint row, __global const float *fixed, __global const float *gain,
    __global const uint *links, __global const float *weights, __global const light_t *outgoing, __global float *light)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t s = i / row;
    uint k = i % row;
    float3 v = (float3)(fixed[(s * 3 + 0) * row + k], fixed[(s * 3 + 1) * row + k], fixed[(s * 3 + 2) * row + k]);
    if (k < rays) {
        size_t r = s * rays + k;
        float3 sent = (float3)(0.0f);
        for (int n = 0; n < BLEND; n++) {
            uint h = links[r * BLEND + n];
            if (IS_LINK(h)) sent += weights[r * BLEND + n] * load_light(outgoing, h);
        }
        v += load3(gain, r) * sent;
    }
    light[(s * 3 + 0) * row + k] = v.x;
    light[(s * 3 + 1) * row + k] = v.y;
    light[(s * 3 + 2) * row + k] = v.z;
}
