/* live_arrival.cl: what arrives along a ray of a live picture: lights and glowing surfaces, and the light field's radiance. */
#include "live_sources.cl"
#include "lookup.cl"
#include "bin_blocks.cl"

/* what rays know: the light field, its means over blocks of bins, tables of elements */
#define FIELD_PARAMETERS                                                                                                          \
    __global const uint *cells, __global const uint *entries, const uint cell_count, __global const uint *near_elements,          \
        __global const float *position, __global const float *frames, __global const light_t *outgoing, __global const float *mean, \
        const int has_field, const float usual, const float least_footprint
#define FIELD cells, entries, cell_count, near_elements, position, frames, outgoing, mean, has_field, usual, least_footprint

/* what lights, domes and surfaces of their own send along a ray, weighted against their being drawn */
inline float3 lit_along(SCENE_PARAMETERS, float3 p, float3 d, int t, float u, float v, float distance, float pdf, int is_mirrored,
                        int is_first)
{
    float3 out = (float3)(0.0f);
    for (int s = 0; s < source_count; s++) {
        __global const float *source = sources + s * SOURCE;
        int kind = (int)source[SRC_KIND];
        if (source[SRC_ALONE] > 0.0f) continue;
        float3 radiance;
        float density;
        if (kind == GLOWING) {
            if (t < 0 || is_mirrored || !(glow_density[t] > 0.0f)) continue;
            radiance = emission_at(materials + material_of[t] * MAT, refs, images, texels, uvs, triangles, t, u, v);
            density = glow_pdf(glow_density, face_normal, t, d, distance);
        } else if (kind == DOME) {
            if (t >= 0) continue;
            radiance = is_mirrored ? dome_about(source, pictures, d) : dome_radiance(source, pictures, d);
            density = source[SRC_SAMPLED] > 0.0f && !is_mirrored ? dome_density(source, tables, d) : 0.0f;
        } else {
            if (is_mirrored) continue;
            Arrival a = meet_source(source, pictures, p, d, t < 0 ? INFINITY : distance);
            if (!(a.density > 0.0f)) continue;
            radiance = a.radiance;
            density = a.density;
        }
        if (density > 0.0f) density *= is_first ? (streams == source_count ? 1.0f : (float)streams * chance_of(sources, source_count, s, p)) : chance_of(sources, source_count, s, p);
        out += radiance * (source[SRC_DIFFUSE] * pdf / (pdf + density));
    }
    return out;
}

/* whether a ray's footprint is too small for the light field to answer it */
inline int is_fine(__global const float *face_normal, const float least_footprint, float3 d, int t, float distance, float pdf)
{
    return is_footprint_fine(least_footprint, inner(load3(face_normal, t), d), distance, pdf);
}

/* bins (4) of elements that point back along a ray */
inline uint4 bins_back(__global const float *frames, uint4 who, float3 d)
{
    __global const float *a = frames + 9 * (size_t)who.x, *b = frames + 9 * (size_t)who.y;
    __global const float *c = frames + 9 * (size_t)who.z, *e = frames + 9 * (size_t)who.w;
#define ALONG(k) (-(d.x * (float4)(a[k], b[k], c[k], e[k]) + d.y * (float4)(a[k + 1], b[k + 1], c[k + 1], e[k + 1]) \
                    + d.z * (float4)(a[k + 2], b[k + 2], c[k + 2], e[k + 2])))
    return as_uint4(quick_bin_of(ALONG(0), ALONG(3), ALONG(6)));
}

/* the light field's radiance against a ray, of elements by their weights; whether it has to be followed instead, if it may */
inline float3 known_by(SCENE_PARAMETERS, FIELD_PARAMETERS, float3 d, int t, float u, float v, float pdf, uint4 who, float4 weight,
                       int *follows)
{
    int may = *follows;
    *follows = 0;
    uint4 bin = bins_back(frames, who, d);
    float3 a, b, c, e;
    if (pdf < WIDE_PDF) {
        uint4 at = who * BLOCK_COUNT + BLOCK_OF(bin);
        a = load3(mean, at.x); b = load3(mean, at.y); c = load3(mean, at.z); e = load3(mean, at.w);
    } else {
        uint4 at = who * D_BINS + bin;
        a = load_light(outgoing, at.x); b = load_light(outgoing, at.y); c = load_light(outgoing, at.z); e = load_light(outgoing, at.w);
    }
    float3 sum = weight.x * a + weight.y * b + weight.z * c + weight.w * e;
    if (glow_density[t] > 0.0f)
        return larger(sum - emission_at(materials + material_of[t] * MAT, refs, images, texels, uvs, triangles, t, u, v), 0.0f);
    float4 each = (float4)(bright(a), bright(b), bright(c), bright(e));
    each = weight > 0.02f ? each : 0.0f;
    float brightest = larger(larger(each.x, each.y), larger(each.z, each.w)), l = bright(sum);
    *follows = may && pdf < WIDE_PDF && (brightest > UNEVEN * larger(l, usual) || l > BRIGHT * usual);
    return *follows ? (float3)(0.0f) : sum;
}

/* the light field's radiance against a ray from p; whether it has to be followed instead */
inline float3 known_along(SCENE_PARAMETERS, FIELD_PARAMETERS, float3 p, float3 d, int t, float u, float v, float distance, float pdf,
                          int *follows)
{
    if (*follows && is_fine(face_normal, least_footprint, d, t, distance, pdf)) return (float3)(0.0f);
    uint4 who;
    float4 weight;
    uint entry = entry_of_point(cells, entries, cell_count, t, u, v, inner(d, load3(face_normal, t)) > 0.0f);
    if (!has_field || !weights_at(near_elements, position, entry, p + distance * d, &who, &weight)) {
        *follows = 0;
        return (float3)(0.0f);
    }
    return known_by(SCENE, FIELD, d, t, u, v, pdf, who, weight, follows);
}
