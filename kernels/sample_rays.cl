/* sample_rays.cl: the light that arrives at the samples of strokes, as the kernels of pictures see it.
 *
 *     draw_rays      of each sample: rays drawn from a mixture of a cosine and several GGX lobes about the eye's mirror direction
 *     arrive         what they met: links to the light field, what lights send, which of them are followed (live_gather.cl)
 *     settle_rays    the light of each ray, and the factor that what surfaces send along it is weighted by
 *     draw_lights    of each sample: directions towards each source
 *     shade_lights   takes away what is in the shade
 *
 * One set of rays serves every level, each ray weighted by one over the density of the whole mixture, lights included (balance
 * heuristic, Veach 1997).  Of a sample, `row` numbers of a channel lie side by side, rays first, then lights, then zeros.
 */
#include "live_lobes.cl"
#include "live_arrival.cl"
#include "links.cl"

/* SCENE with other rows of sources: those that lights' specular factors scale */
#define SCENE_OF(rows) \
    triangles, corners, face_normal, material_of, materials, refs, images, texels, uvs, source_count, streams, rows, pictures, \
        tables, drawn, glowing_count, glowing, cumulative, glow_density

/* width of a lobe at a sample, whose first is as narrow as the sample's own */
#define ALPHA_OF(t) ((t) == 0 ? narrowest : alphas[t])

/* expected number of rays per steradian, over all techniques */
inline float mixture_density(float narrowest, int lobes, __constant float *alphas, __constant float *counts, float3 e, float3 l)
{
    if (l.z <= 0.0f) return 0.0f;
    float p = counts[0] * l.z / PI_F;
    float3 h = unit(e + l);
    for (int t = 0; t < lobes; t++) p += counts[t + 1] * visible_pdf(ALPHA_OF(t), ggx_of_half(ALPHA_OF(t), h), e.z);
    return p;
}

inline void put_channels(float3 v, __global float *to, size_t s, uint row, uint k)
{
    to[(s * 3 + 0) * row + k] = v.x;
    to[(s * 3 + 1) * row + k] = v.y;
    to[(s * 3 + 2) * row + k] = v.z;
}

/* one work-item a ray, of samples from `first` on
 * eye        (S, 3) local, z > 0
 * frames     (S, 3, 3)
 * origin, geometric (S, 3): off the surface; the normal of its side
 * u          (S, K, 2) in [0, 1)
 * technique  (K) 0 cosine, t lobe t
 * first_alpha (S) of the first lobe; alphas (lobes) of the others; counts (lobes + 1) rays of each technique
 * towards    (S, 3, row) local; ray_* (count): what is traced, of length 0 where it goes below the horizon, and folded up where the
 *            shading normal alone sends it out; density (count) negative where it was; 0 below the horizon: results
 */
__kernel void draw_rays(
    const uint count, const uint first, const uint rays, const uint row, __global const float *eye, __global const float *frames,
    __global const float *origin, __global const float *geometric, __global const float *first_alpha, __global const float2 *u,
    __global const int *technique, const int lobes, __constant float *alphas, __constant float *counts, __global float *towards, __global float *ray_origin,
    __global float *ray_direction, __global float *ray_length, __global float *density)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t s = first + i / rays;
    uint k = i % rays;
    float3 e = load3(eye, s), l;
    float narrowest = first_alpha[s];
    int t = technique[k];
    float2 x = u[s * rays + k];
    if (t == 0) {
        l = (float3)(sqrt(x.x) * cos_sin_of_turn(x.y), sqrt(larger(1.0f - x.x, 0.0f)));
    } else {
        Triple mirrored, h;
        mirrored_by_ggx(ALPHA_OF(t - 1), triple(e), x.x, x.y, &mirrored, &h);
        l = vector(mirrored);
    }
    float3 d = world_from_local(frames, s, l), n = load3(geometric, s);
    float expected = mixture_density(narrowest, lobes, alphas, counts, e, l), below = inner(n, d);
    if (below < 0.0f) d -= 2.0f * below * n;
    put_channels(l, towards, s, row, k);
    store3(load3(origin, s), ray_origin, i);
    store3(d, ray_direction, i);
    ray_length[i] = expected > 0.0f ? 1e37f : 0.0f;
    density[i] = below < 0.0f ? -expected : expected;
}

/* what rays met
 * rays, light_rays: of a sample, in all and towards each source, for the densities of one
 * may_follow: pictures' light is asked for; else the light field's is all that counts
 * specular_sources: rows of sources whose diffuse factors are their specular ones, where these differ
 * links, weights (S * rays, 4), from ray `first` on: results
 * lit_specular (count, 3): result, of lights by their specular factors
 * arrived (count, 8) of lights, of surfaces; state, followed: as of arrive_first of live_gather.cl
 */
__kernel void arrive(
    const uint count, const uint first, const float rays, const float light_rays, const int may_follow, SCENE_PARAMETERS,
    FIELD_PARAMETERS, __global const float *ray_origin, __global const float *ray_direction, __global const float *ray_length,
    __global const int *triangle, __global const float *u_of, __global const float *v_of, __global const float *distance,
    __global const float *density, const int is_split, __global const float *specular_sources, __global uint *links,
    __global float *weights, __global float *arrived, __global float *lit_specular, __global float *state,
    __global uchar *followed)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t to = (size_t)(first + i) * BLEND;
    int t = triangle[i], is_there = ray_length[i] > 0.0f;
    followed[i] = 0;
    for (int k = 0; k < BLEND; k++) {
        links[to + k] = ESCAPES;
        weights[to + k] = 0.0f;
    }
    float3 lit = (float3)(0.0f), bounced = (float3)(0.0f), d = load3(ray_direction, i);
    float expected = fabs(density[i]);
    float of_light = expected / light_rays;
    int folded = density[i] < 0.0f;
    float3 p = load3(ray_origin, i), specular = (float3)(0.0f);
    if (is_there) lit = lit_along(SCENE, p, d, t, u_of[i], v_of[i], distance[i], of_light, folded, 1);
    if (is_there && is_split)
        specular = lit_along(SCENE_OF(specular_sources), p, d, t, u_of[i], v_of[i], distance[i], of_light, folded, 1);
    if (is_split) store3(specular, lit_specular, i);
    uint4 who;
    float4 weight;
    uint entry = NO_ENTRY;
    if (is_there && t >= 0) entry = entry_of_point(cells, entries, cell_count, t, u_of[i], v_of[i], inner(d, load3(face_normal, t)) > 0.0f);
    if (is_there && t >= 0 && entry == NO_ENTRY)
        for (int k = 0; k < BLEND; k++) links[to + k] = BLOCKED;
    if (entry != NO_ENTRY && weights_at(near_elements, position, entry, p + distance[i] * d, &who, &weight)) {
        uint4 link = who * D_BINS + bins_back(frames, who, d);
        vstore4(weight > 0.0f ? link : ESCAPES, 0, links + to);
        vstore4(weight, 0, weights + to);
        if (may_follow) {
            int follows = 1;
            if (!is_fine(face_normal, least_footprint, d, t, distance[i], expected / rays))
                bounced = known_by(SCENE, FIELD, d, t, u_of[i], v_of[i], expected / rays, who, weight, &follows);
            followed[i] = follows;
            __global float *s = state + (size_t)i * PATH;
            s[0] = s[1] = s[2] = 1.0f;
            s[3] = expected / rays;
            s[4] = as_float(i);
            s[10] = as_float(first + i);
            s[11] = as_float(1u);
        }
    }
    put3(lit, arrived + (size_t)i * 8, 0);
    put3(bounced, arrived + (size_t)i * 8, 3);
}

/* light of rays over their density, and what surfaces send along them is to be multiplied by
 * least, most: share of what is sent that has to be reflected, for pictures' light to be compared with it; their largest ratio
 * weight (S) of a sample's light
 * fixed, fixed_specular (S, 3, row): the latter another one where lights' factors differ; gain (S * rays, 3): results
 */
__kernel void settle_rays(
    const uint count, const uint first, const uint rays, const uint row, const int is_pictured, const float least,
    const float most, SCENE_PARAMETERS, __global const light_t *outgoing, __global const int *triangle, __global const float *u_of,
    __global const float *v_of, __global const float *density, __global const float *arrived, __global const float *lit_specular,
    __global const uint *links, __global const float *weights, __global const float *weight, __global float *fixed, __global float *fixed_specular,
    __global float *gain)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t r = first + i, s = r / rays;
    float expected = fabs(density[i]), inverse = expected > 0.0f ? weight[s] / expected : 0.0f;
    float3 factor = (float3)(1.0f), sent = (float3)(0.0f), own = (float3)(0.0f);
    for (int k = 0; k < BLEND; k++) {
        uint h = links[r * BLEND + k];
        if (IS_LINK(h)) sent += weights[r * BLEND + k] * load_light(outgoing, h);
    }
    if (largest(sent) > 0.0f) {
        size_t t = triangle[i];
        if (glow_density[t] > 0.0f)
            own = emission_at(materials + material_of[t] * MAT, refs, images, texels, uvs, triangles, t, u_of[i], v_of[i]);
        if (is_pictured) {
            float3 reflected = sent - own, seen = row3(arrived + (size_t)i * 8, 3);
            factor.x = reflected.x > least * sent.x ? lesser(seen.x / reflected.x, most) : 1.0f;
            factor.y = reflected.y > least * sent.y ? lesser(seen.y / reflected.y, most) : 1.0f;
            factor.z = reflected.z > least * sent.z ? lesser(seen.z / reflected.z, most) : 1.0f;
        }
    }
    /* what shines by itself was met as a light, and is no part of what is reflected */
    float3 lit = row3(arrived + (size_t)i * 8, 0);
    put_channels(inverse * (lit - factor * own), fixed, s, row, (uint)(r % rays));
    if (fixed_specular != fixed)
        put_channels(inverse * (load3(lit_specular, i) - factor * own), fixed_specular, s, row, (uint)(r % rays));
    store3(inverse * factor, gain, r);
}

/* one work-item a direction towards a source, of samples from `first` on
 * per_sample   directions of a sample; drawn_of (per_sample, 3): the source of each, how many that source has, which of them it is
 * u            (S, per_sample, 2)
 * place        (S) of samples in the drawn directions of domes
 * fixed, fixed_specular (S, 3, row): light over density, by the lights' diffuse and specular factors
 * shadow_* (count): what is traced
 */
__kernel void draw_lights(
    const uint count, const uint first, const uint per_sample, const uint rays, const uint row, SCENE_PARAMETERS,
    __global const float *eye, __global const float *frames, __global const float *origin, __global const float *geometric,
    __global const float *first_alpha, __global const float2 *u, __global const uint *place, __global const int *drawn_of, __global const float *weight, const int lobes,
    __constant float *alphas, __constant float *counts, __global float *towards,
    __global float *fixed, __global float *fixed_specular, __global float *shadow_origin, __global float *shadow_direction,
    __global float *shadow_length)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t s = first + i / per_sample;
    uint j = i % per_sample;
    int chosen = drawn_of[3 * j];
    __global const float *source = sources + chosen * SOURCE;
    float3 p = load3(origin, s), e = load3(eye, s);
    float narrowest = first_alpha[s];
    Arrival a = draw_source(SCENE, chosen, p, u[s * per_sample + j], (place[s] + drawn_of[3 * j + 2]) % DRAWN);
    float3 l = local_from_world(frames, s, a.direction);
    int shines = source[SRC_SAMPLED] > 0.0f && a.density > 0.0f && largest(a.radiance) > 0.0f && l.z > 0.0f && inner(load3(geometric, s), a.direction) > 0.0f;
    float alone = source[SRC_ALONE] > 0.0f ? 0.0f : mixture_density(narrowest, lobes, alphas, counts, e, l); /* rays do not meet what is alone */
    float3 light = shines ? a.radiance * (weight[s] / (drawn_of[3 * j + 1] * a.density + alone)) : (float3)(0.0f);
    put_channels(l, towards, s, row, rays + j);
    put_channels(light * source[SRC_DIFFUSE], fixed, s, row, rays + j);
    if (fixed_specular != fixed) put_channels(light * source[SRC_SPECULAR], fixed_specular, s, row, rays + j);
    store3(p, shadow_origin, i);
    store3(a.direction, shadow_direction, i);
    shadow_length[i] = shines ? lesser(a.distance * (1.0f - 1e-4f), 1e37f) : 0.0f;
}

/* light that something is in the way of is taken away; arguments as above */
__kernel void shade_lights(
    const uint count, const uint first, const uint per_sample, const uint rays, const uint row,
    __global const float *shadow_length, __global const uchar *blocked, __global float *fixed, __global float *fixed_specular)
{
    uint i = get_global_id(0);
    if (i >= count || !(shadow_length[i] > 0.0f) || !blocked[i]) return;
    size_t s = first + i / per_sample;
    put_channels((float3)(0.0f), fixed, s, row, rays + i % per_sample);
    put_channels((float3)(0.0f), fixed_specular, s, row, rays + i % per_sample);
}
