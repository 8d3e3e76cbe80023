/* evidence.cl: what light arrives at painted samples, and the columns that each roughness makes of it.
 *
 * Each sample draws its rays from a mixture of a cosine and several GGX lobes about the eye's mirror direction; one set of rays
 * serves every level, each ray weighted by one over the density of the whole mixture (balance heuristic, Veach 1997).
 * Build constant LOBES: lobes of the mixture, the cosine not counted.
 */
#include "reflectance.cl"

/* visible normals of GGX.  Heitz 2018 */
inline float3 sample_visible_normal(float alpha, float3 e, float2 u)
{
    float3 v = normalize((float3)(alpha * e.x, alpha * e.y, e.z));
    float3 t, b;
    frame_about(v, &t, &b);
    float r = sqrt(u.x), phi = 2.0f * PI_F * u.y;
    float x = r * cos(phi), y = r * sin(phi);
    float s = 0.5f * (1.0f + v.z);
    /* t lies across z x v, as the projected disk needs */
    float3 side = v.z < 0.9999f ? normalize((float3)(-v.y, v.x, 0.0f)) : (float3)(1.0f, 0.0f, 0.0f);
    float3 up = cross(v, side);
    y = (1.0f - s) * sqrt(max(1.0f - x * x, 0.0f)) + s * y;
    float3 h = x * side + y * up + sqrt(max(1.0f - x * x - y * y, 0.0f)) * v;
    return normalize((float3)(alpha * h.x, alpha * h.y, max(h.z, 1e-6f)));
}

/* density of the lobe's directions [1/sr]: D G1 / (4 N.E) */
inline float lobe_density(float alpha, float3 e, float3 l)
{
    float3 h = normalize(e + l);
    float a2 = alpha * alpha;
    float g = 2.0f / (e.z + sqrt(a2 + (1.0f - a2) * e.z * e.z));
    return ggx_distribution(alpha, clamp(h.z, 0.0f, 1.0f)) * g * 0.25f;
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
        float3 h = sample_visible_normal(alphas[t - 1], e, u[i]);
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

/* the columns of each sample at each of its levels, one work-item a (level, sample)
 * eye        (S, 3) local
 * light_row  (S) row of `towards` and `light` that the sample sees
 * towards     (R, K, 3)
 * light      (R, K, 3) radiance over density
 * parameters (S, J) alpha, or the Phong exponent
 * columns    (S, J, 4, 3): result
 */
__kernel void columns(__global const float *eye, __global const int *light_row, __global const float *towards,
                      __global const float *light, __global const float *parameters, const uint rays, const uint levels,
                      const uint samples, __global float *columns)
{
    uint j = get_global_id(0), s = get_global_id(1);
    if (j >= levels || s >= samples) return;
    float3 e = load3(eye, s), x = 0.0f, y = 0.0f, a = 0.0f, b = 0.0f;
    float parameter = parameters[s * levels + j];
    size_t from = (size_t)light_row[s] * rays;
    for (uint k = 0; k < rays; k++) {
        float3 radiance = load3(light, from + k);
        float3 l = load3(towards, from + k);
#if PHONG
        float4 c = phong_columns(parameter, e, l);
#else
        float4 c = preview_surface_columns(parameter, e, l);
#endif
        x += c.x * radiance; y += c.y * radiance; a += c.z * radiance; b += c.w * radiance;
    }
    size_t to = ((size_t)s * levels + j) * 4;
    store3(x, columns, to);
    store3(y, columns, to + 1);
    store3(a, columns, to + 2);
    store3(b, columns, to + 3);
}
