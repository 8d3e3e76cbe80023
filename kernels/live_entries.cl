/* live_entries.cl: which elements the rays of a live picture meet, step by step: few reads at random in each, so that a device waits
 * for many of them at once.
 *
 *     entries_of_rays   the cell of the surface that each met, or that it has to be followed
 *     blends_of_rays    the four elements there, and their weights
 */
#include "live_records.cl"

/* may_follow, least_footprint: whether rays of a small footprint are followed, and how small it is
 * ray_direction (n, 3), ray_length, triangle, u_of, v_of, distance (n): rays and what they met
 * drawn_ray (DRAWN_RAY, rays); face_normal (T, 3); cells, entries, cell_count of the tables
 * entry_of (n) result: entries, IS_FOLLOWED, or NO_ENTRY where no light of elements is met
 */
__kernel void entries_of_rays(
    const uint count, const uint rays, const int may_follow, const float least_footprint, __global const float *ray_direction,
    __global const float *ray_length, __global const int *triangle, __global const float *u_of, __global const float *v_of,
    __global const float *distance, __global const float *drawn_ray, __global const float *face_normal,
    __global const uint *cells, __global const uint *entries, const uint cell_count, __global uint *entry_of)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    int is_there = (ray_length[i] > 0.0f) & (triangle[i] >= 0);
    size_t t = is_there ? triangle[i] : 0;
    __global const float *n = face_normal + 3 * t, *d = ray_direction + 3 * i;
    float facing = d[0] * n[0] + d[1] * n[1] + d[2] * n[2];
    facing = is_there ? facing : 1.0f;
    float u = is_there ? u_of[i] : 0.0f, v = is_there ? v_of[i] : 0.0f;
    uint entry = entry_of_point(cells, entries, cell_count, t, u, v, facing > 0.0f);
    int is_fine = is_footprint_fine(least_footprint, facing, distance[i], drawn_ray[RAY_LOBE_PDF * (size_t)rays + i]);
    entry = may_follow & is_fine ? IS_FOLLOWED : entry;
    entry_of[i] = is_there ? entry : NO_ENTRY;
}

/* who, weight (4, rays) results, for rays that meet light of elements; near_elements (entries, PER_ENTRY), position (N, 3) */
__kernel void blends_of_rays(
    const uint count, const uint rays, __global const uint *entry_of, __global const float *ray_origin,
    __global const float *ray_direction, __global const float *distance, __global const uint *near_elements,
    __global const float *position, __global uint *who, __global float *weight)
{
    uint i = get_global_id(0), at = i < count ? i : count - 1;
    uint entry = entry_of[at];
    int is_there = entry < IS_FOLLOWED;
    float s = is_there ? distance[at] : 0.0f;
    Triple p = plus(triple(ray_origin, 3 * at), times(s, triple(ray_direction, 3 * at)));
    Blend o = blend_of_list(position, near_elements + (size_t)(is_there ? entry : 0) * PER_ENTRY, p);
    if (i >= count) return;
    who[i] = o.a;
    who[rays + i] = o.b;
    who[2 * rays + i] = o.c;
    who[3 * rays + i] = o.d;
    weight[i] = o.wa;
    weight[rays + i] = o.wb;
    weight[2 * rays + i] = o.wc;
    weight[3 * rays + i] = o.wd;
}
