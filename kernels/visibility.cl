/* visibility.cl: the operator G.  Names, for each ray that left an element, the element and bin it arrives at.
 *
 *     rays_of_bins      origins and directions, from which they are traced
 *     entries_of_hits   the cell of the surface that each met
 *     nearest_of_hits   the element nearest to the hit, and the ray in its frame
 *     pack_hits         that element and the bin that points back along the ray
 *
 * Nguyen et al. 2013, 6.1; what their splats decide in screen space, the cells of lookup.cl decide on the surface.
 * Four kernels and not one: all but the third have no branches, so that a CPU puts work-items into its lanes, and few
 * reads at random, so that it waits for many of them at once.  The third reads whole rows, one work-item at a time.
 */
#include "links.cl"

#define DISTANCE_BITS 0xfffffffcu /* of the four elements of an entry that are compared: the nearest is one of them 1999 times in 2000 */

/* bin of a local direction of any length as bin_of does, below the horizon its rim, without calls
 * atan on 0..1: Abramowitz and Stegun's form, refitted, within 2e-6 */
inline uint bin_of_lane(float x, float y, float z)
{
    z = LARGER(z, 0.0f);
    float length = sqrt(x * x + y * y + z * z);
    float height = 1.0f - z / LARGER(length, 1e-30f);
    float r = sqrt(LARGER(height, 0.0f));
    float ax = x < 0.0f ? -x : x, ay = y < 0.0f ? -y : y;
    int wide = ax > ay;
    float big = wide ? ax : ay, small = wide ? ay : ax;
    float q = small / LARGER(big, 1e-30f), q2 = q * q;
    float angle = q * (0.99997726f + q2 * (-0.33262347f + q2 * (0.19354346f + q2 * (-0.11643287f
                + q2 * (0.05265332f - 0.01172120f * q2)))));
    float second = r * angle * (4.0f / PI_F);
    float a = wide ? r : second, b = wide ? second : r;
    a = x < 0.0f ? -a : a;
    b = y < 0.0f ? -b : b;
    int ix = (a + 1.0f) * (0.5f * SIDE), iy = (b + 1.0f) * (0.5f * SIDE);
    return LESSER(iy, SIDE - 1) * SIDE + LESSER(ix, SIDE - 1);
}

/* ray               (n) element * D + bin of each
 * least             least cosine between a ray and the true normal, to which lower rays are lifted
 * bins              (D, 3) local directions
 * start             (N, 3) origins of rays
 * geometric_normal  (N, 3)
 * frames            (N, 3, 3)
 * origin, direction (n, 3) results
 */
__kernel void rays_of_bins(const uint count, __global const uint *ray, const float least, __global const float *bins,
                           __global const float *start, __global const float *geometric_normal,
                           __global const float *frames, __global float *origin, __global float *direction)
{
    uint r = get_global_id(0);
    if (r >= count) return;
    uint i = ray[r] / D_BINS, d = ray[r] % D_BINS;
    __global const float *f = frames + 9 * (size_t)i, *g = geometric_normal + 3 * i, *l = bins + 3 * d;
    float x = l[0] * f[0] + l[1] * f[3] + l[2] * f[6];
    float y = l[0] * f[1] + l[1] * f[4] + l[2] * f[7];
    float z = l[0] * f[2] + l[1] * f[5] + l[2] * f[8];
    float below = least - (x * g[0] + y * g[1] + z * g[2]);
    below = LARGER(below, 0.0f);
    x += below * g[0]; y += below * g[1]; z += below * g[2];
    float scale = 1.0f / sqrt(x * x + y * y + z * z);
    direction[3 * r] = x * scale; direction[3 * r + 1] = y * scale; direction[3 * r + 2] = z * scale;
    origin[3 * r] = start[3 * i]; origin[3 * r + 1] = start[3 * i + 1]; origin[3 * r + 2] = start[3 * i + 2];
}

/* direction         (n, 3)
 * triangle          (n) that was hit, -1 for none
 * u, v              (n) barycentrics of the hit
 * face_normal       (T, 3)
 * cells, entries, cell_count: of the tables
 * found             (n) result: entries, ESCAPES for a miss, BLOCKED for a side without elements
 */
__kernel void entries_of_hits(const uint count, __global const float *direction, __global const int *triangle,
                              __global const float *u, __global const float *v, __global const float *face_normal,
                              __global const uint *cells, __global const uint *entries, const uint cell_count,
                              __global uint *found)
{
    uint r = get_global_id(0);
    if (r >= count) return;
    int escapes = triangle[r] < 0;
    size_t t = escapes ? 0 : triangle[r];
    __global const float *n = face_normal + 3 * t, *d = direction + 3 * r;
    int back = d[0] * n[0] + d[1] * n[1] + d[2] * n[2] > 0.0f;
    uint entry = entry_of_point(cells, entries, cell_count, t, u[r], v[r], back);
    entry = entry == NO_ENTRY ? BLOCKED : entry;
    found[r] = escapes ? ESCAPES : entry;
}

/* origin, direction (n, 3)
 * distance          (n) of the hit
 * near_elements     (entries, PER_ENTRY)
 * placed            (N, 4, 4) of each element, a line of the cache: position, and the three columns of its frame
 * found             (n) of entries_of_hits: in, entries; out, the elements in their place
 * back              (3, n) result: the direction back along the ray, in the element's frame
 */
__kernel void nearest_of_hits(const uint count, __global const float *origin, __global const float *direction,
                              __global const float *distance, __global const uint *near_elements,
                              __global const float *placed, __global uint *found, __global float *back)
{
    uint r = get_global_id(0);
    if (r >= count) return;
    uint at = found[r];
    if (!IS_LINK(at)) {
        back[r] = back[count + r] = back[2 * count + r] = 0.0f;
        return;
    }
    float s = distance[r], x = direction[3 * r], y = direction[3 * r + 1], z = direction[3 * r + 2];
    uint4 list = vload4(0, near_elements + (size_t)at * PER_ENTRY);
    float4 p = (float4)(origin[3 * r] + s * x, origin[3 * r + 1] + s * y, origin[3 * r + 2] + s * z, 0.0f);
    float4 a = vload4(4 * (size_t)list.x, placed) - p, b = vload4(4 * (size_t)list.y, placed) - p;
    float4 c = vload4(4 * (size_t)list.z, placed) - p, e = vload4(4 * (size_t)list.w, placed) - p;
    float4 dx = (float4)(a.x, b.x, c.x, e.x), dy = (float4)(a.y, b.y, c.y, e.y), dz = (float4)(a.z, b.z, c.z, e.z);
    /* The place in the list rides in the last bits of the squared distance, which orders as its bits do. */
    uint4 key = (as_uint4(dx * dx + dy * dy + dz * dz) & DISTANCE_BITS) | (uint4)(0, 1, 2, 3);
    uint2 two = LESSER(key.xy, key.zw);
    uint k = LESSER(two.x, two.y) & ~DISTANCE_BITS;
    uint nearest = near_elements[(size_t)at * PER_ENTRY + k];
    __global const float *q = placed + 16 * (size_t)nearest;
    float4 towards = -(x * vload4(1, q) + y * vload4(2, q) + z * vload4(3, q));
    back[r] = towards.x; back[count + r] = towards.y; back[2 * count + r] = towards.z;
    found[r] = nearest;
}

/* found, back       of nearest_of_hits
 * hit               (n) result: links
 */
__kernel void pack_hits(const uint count, __global const uint *found, __global const float *back, __global uint *hit)
{
    uint r = get_global_id(0);
    if (r >= count) return;
    uint e = found[r], link = LINK(e, bin_of_lane(back[r], back[count + r], back[2 * count + r]));
    hit[r] = IS_LINK(e) ? link : e;
}
