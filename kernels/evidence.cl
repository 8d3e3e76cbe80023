/* evidence.cl: what light arrives at painted samples, and the columns that each roughness makes of it.
 *
 * Each sample draws its rays from a mixture of a cosine and several GGX lobes about the eye's mirror direction; one set of rays
 * serves every level, each ray weighted by one over the density of the whole mixture (balance heuristic, Veach 1997).
 * Build constant LOBES: lobes of the mixture, the cosine not counted.
 */
#include "reflectance.cl"

/* density [1/sr] of the directions that a lobe's visible normals mirror the eye to */
inline float lobe_density(float alpha, float3 e, float3 l)
{
    return visible_pdf(alpha, ggx_of_half(alpha, normalize(e + l)), e.z);
}

/* expected number of rays per steradian, over all techniques */
inline float mixture_density(__constant float *alphas, __constant float *counts, float3 e, float3 l)
{
    if (l.z <= 0.0f) return 0.0f;
    float p = counts[0] * l.z / PI_F;
    for (int t = 0; t < LOBES; t++) p += counts[t + 1] * lobe_density(alphas[t], e, l);
    return p;
}

/* one work-item a ray
 * eye        (S, 3) local, z > 0
 * frames     (S, 3, 3)
 * u          (S, K, 2) in [0, 1)
 * technique  (K) 0 cosine, t lobe t
 * alphas     (LOBES); counts (LOBES + 1) rays of each technique
 * towards     (S, K, 3), world (S, K, 3), density (S, K): results; density 0 below the horizon
 */
__kernel void make_rays(__global const float *eye, __global const float *frames, __global const float2 *u,
                        __global const int *technique, __constant float *alphas, __constant float *counts,
                        const uint rays, const uint count, __global float *towards, __global float *world,
                        __global float *density)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    uint s = i / rays;
    float3 e = load3(eye, s), l;
    int t = technique[i % rays];
    if (t == 0) {
        float r = sqrt(u[i].x), phi = 2.0f * PI_F * u[i].y;
        l = (float3)(r * cos(phi), r * sin(phi), sqrt(max(1.0f - u[i].x, 0.0f)));
    } else {
        float3 h = visible_normal(alphas[t - 1], e, u[i]);
        l = 2.0f * dot(e, h) * h - e;
    }
    store3(l, towards, i);
    store3(world_from_local(frames, s, l), world, i);
    density[i] = mixture_density(alphas, counts, e, l);
}

/* the mixture's density at given directions, local (S, K, 3) */
__kernel void density_at(__global const float *eye, __global const float *towards, __constant float *alphas,
                         __constant float *counts, const uint rays, const uint count, __global float *density)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    density[i] = mixture_density(alphas, counts, load3(eye, i / rays), load3(towards, i));
}

DEFINE_GGX(float16, ggx_distribution16)
DEFINE_SMITH(float16, smith_visibility16)
DEFINE_MODEL(float16, model16, ggx_distribution16, smith_visibility16)

inline float sum16(float16 v)
{
    float8 a = v.lo + v.hi;
    float4 b = a.lo + a.hi;
    return b.x + b.y + b.z + b.w;
}

/* the columns of each sample at each of its levels, one work-item a (level, sample), sixteen rays at a time
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
    uint j = get_global_id(0), s = get_global_id(1);
    if (j >= levels || s >= samples) return;
    float3 e = load3(eye, s);
    float parameter = parameters[s * levels + j];
    float16 sum[4][3];
    for (int k = 0; k < 4; k++) for (int c = 0; c < 3; c++) sum[k][c] = 0.0f;
    __global const float16 *to = towards + (size_t)light_row[s] * 3 * packs;
    __global const float16 *radiance = light + (size_t)light_row[s] * 3 * packs;
    for (uint i = 0; i < packs; i++) {
        float16 column[4];
        model16(parameter, e.x, e.y, e.z, to[i], to[packs + i], to[2 * packs + i], &column[0], &column[1], &column[2],
                &column[3]);
        for (int c = 0; c < 3; c++) {
            float16 r = radiance[c * packs + i];
            for (int k = 0; k < 4; k++) sum[k][c] += column[k] * r;
        }
    }
    for (int k = 0; k < 4; k++)
        store3((float3)(sum16(sum[k][0]), sum16(sum[k][1]), sum16(sum[k][2])), columns, ((size_t)s * levels + j) * 4 + k);
}
