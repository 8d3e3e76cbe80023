/* visibility.cl: the operator G.  Names, for each ray that left an element, the element and bin it arrives at.
 *
 * Nguyen et al. 2013, 6.1; what their splats decide in screen space, the cells of lookup.cl decide on the surface.
 */
#include "lookup.cl"

/* lifts a direction that points below the true surface of its element to just above it */
inline float3 above_surface(float3 w, float3 n, float least)
{
    float c = dot(w, n);
    return c < least ? normalize(w + (least - c) * n) : w;
}

/* count             rays of this batch, elements in order, D each
 * first             element of the first ray
 * least             least cosine between a ray and the true normal
 * triangle          (n) that was hit, -1 for none
 * u, v              (n) barycentrics of the hit
 * distance          (n)
 * bins              (D, 3) local directions
 * start             (N, 3) origins of rays
 * geometric_normal  (N, 3)
 * frames            (N, 3, 3)
 * face_normal       (T, 3)
 * cells, entries, cell_count, near_elements, position: the tables
 * hit               (n) result: element << 10 | bin, ESCAPES, or BLOCKED
 */
__kernel void pack_hits(const uint count, const uint first, const float least, __global const int *triangle,
                        __global const float *u, __global const float *v, __global const float *distance,
                        __global const float *bins, __global const float *start, __global const float *geometric_normal,
                        __global const float *frames, __global const float *face_normal, __global const uint *cells,
                        __global const uint *entries, const uint cell_count, __global const uint *near_elements,
                        __global const float *position, __global uint *hit)
{
    size_t r = get_global_id(0);
    if (r >= count) return;
    int t = triangle[r];
    if (t < 0) { hit[r] = ESCAPES; return; }
    size_t i = first + r / D_BINS;
    float3 w = world_from_local(frames, i, load3(bins, r % D_BINS));
    w = above_surface(w, load3(geometric_normal, i), least);
    int back = dot(w, load3(face_normal, t)) > 0.0f;
    uint entry = entry_of_point(cells, entries, cell_count, t, u[r], v[r], back);
    if (entry == NO_ENTRY) { hit[r] = BLOCKED; return; }
    uint e = nearest_of_entry(near_elements, position, entry, load3(start, i) + distance[r] * w);
    hit[r] = e << 10 | (uint)bin_of(local_from_world(frames, e, -w));
}
