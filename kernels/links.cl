/* links.cl: what rays arrive at, element and bin packed in one number.  Device twin of usdslf/light_field/links.py.
 *
 *     link = element << 10 | bin       a row of an (N, D, 3) array
 */
#include "lookup.cl"

#define ESCAPES 0xffffffffu /* nothing is hit */
#define BLOCKED 0xfffffffeu /* a side is hit that no light reaches */
#define LINK(e, bin) ((uint)(e) * D_BINS + (uint)(bin))
#define IS_LINK(h) ((h) < BLOCKED)
#define ELEMENT_OF(h) ((h) / D_BINS)
#define BIN_OF(h) ((h) % D_BINS)

/* what rays arrive at: the elements that are blended at each hit, and the bin in which each sends light back
 * count          rays
 * triangle       (n) that was hit, -1 for none
 * barycentric    (n, 2)
 * direction      (n, 3) of travel
 * face_normal    (T, 3)
 * corners        (T, 3, 3)
 * cells, entries, cell_count, near_elements (entries, PER_ENTRY), position (N, 3): the tables
 * frames         (N, 3, 3)
 * link           (n, 4) result: element << 10 | bin, ESCAPES for a miss, BLOCKED for a side without elements
 * weight         (n, 4) result: sums to 1, or 0
 */
__kernel void link_rays(const uint count, __global const int *triangle, __global const float *barycentric,
                        __global const float *direction, __global const float *face_normal,
                        __global const float *corners, __global const uint *cells, __global const uint *entries,
                        const uint cell_count, __global const uint *near_elements, __global const float *position,
                        __global const float *frames, __global uint *link, __global float *weight)
{
    size_t r = get_global_id(0);
    if (r >= count) return;
    int escapes = triangle[r] < 0;
    size_t t = escapes ? 0 : triangle[r];
    float3 w = load3(direction, r);
    uint who[BLEND + 1];
    float share[BLEND];
    blend_at(corners, cells, entries, cell_count, near_elements, position, t, barycentric[2 * r], barycentric[2 * r + 1],
             dot(w, load3(face_normal, t)) > 0.0f, who, share);
    int blocked = share[0] == 0.0f;
    for (int k = 0; k < BLEND; k++) {
        uint to = blocked ? BLOCKED : LINK(who[k], bin_of(local_from_world(frames, blocked ? 0 : who[k], -w)));
        link[r * BLEND + k] = escapes ? ESCAPES : to;
        weight[r * BLEND + k] = escapes ? 0.0f : share[k];
    }
}

/* radiance carried by links
 * links    (n, BLEND); weights (n, BLEND)
 * outgoing (N, D, 3)
 * radiance (n, 3): result
 */
__kernel void follow_links(__global const uint *links, __global const float *weights, __global const light_t *outgoing,
                           const uint count, __global float *radiance)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    float3 v = (float3)(0.0f);
    for (int k = 0; k < BLEND; k++) {
        uint h = links[i * BLEND + k];
        if (IS_LINK(h)) v += weights[i * BLEND + k] * load_light(outgoing, h);
    }
    store3(v, radiance, i);
}
