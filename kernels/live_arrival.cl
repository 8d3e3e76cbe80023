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
    float cosine = fabs(inner(load3(face_normal, t), d));
    return distance * distance / larger(pdf * larger(cosine, 0.05f), 1e-6f) < least_footprint;
}

/* the light field's radiance against a ray, of the elements of an entry by their weights (PER_ENTRY); whether it has to be followed
 * instead, if it may */
inline float3 known_by(SCENE_PARAMETERS, FIELD_PARAMETERS, float3 d, int t, float u, float v, float pdf, uint entry, const float *weight,
                       int *follows)
{
    float brightest = 0.0f;
    float3 sum = (float3)(0.0f);
    int may = *follows;
    *follows = 0;
    for (int k = 0; k < PER_ENTRY; k++) {
        if (!(weight[k] > 0.0f)) continue;
        uint e = near_elements[(size_t)entry * PER_ENTRY + k];
        int bin = quick_bin_of(local_from_world(frames, e, -d));
        float3 one = pdf < WIDE_PDF ? load3(mean, (size_t)e * BLOCK_COUNT + block_of(bin)) : load_light(outgoing, (size_t)e * D_BINS + bin);
        sum += weight[k] * one;
        if (weight[k] > 0.02f) brightest = larger(brightest, bright(one));
    }
    if (glow_density[t] > 0.0f)
        return larger(sum - emission_at(materials + material_of[t] * MAT, refs, images, texels, uvs, triangles, t, u, v), 0.0f);
    float l = bright(sum);
    *follows = may && pdf < WIDE_PDF && (brightest > UNEVEN * larger(l, usual) || l > BRIGHT * usual);
    return *follows ? (float3)(0.0f) : sum;
}

/* the light field's radiance against a ray; whether it has to be followed instead */
inline float3 known_along(SCENE_PARAMETERS, FIELD_PARAMETERS, float3 d, int t, float u, float v, float distance, float pdf, int *follows)
{
    if (*follows && is_fine(face_normal, least_footprint, d, t, distance, pdf)) return (float3)(0.0f);
    float weight[PER_ENTRY];
    uint entry = entry_of_point(cells, entries, cell_count, t, u, v, inner(d, load3(face_normal, t)) > 0.0f);
    if (!has_field || !weights_at(corners, near_elements, position, entry, t, u, v, weight)) {
        *follows = 0;
        return (float3)(0.0f);
    }
    return known_by(SCENE, FIELD, d, t, u, v, pdf, entry, weight, follows);
}
