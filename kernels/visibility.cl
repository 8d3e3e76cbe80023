/* visibility.cl: the operator G.  Names, for each ray that left an element, the element and bin it arrives at.
 *
 * Nguyen et al. 2013, 6.1; what their splats decide in screen space, the cells of lookup.cl decide on the surface.
 * Written without branches, so that a CPU puts work-items into its lanes.
 */
#include "links.cl"

#define COMPARED 4  /* elements of an entry that are compared; the nearest is one of them 1999 times in 2000 */
#define DISTANCE_BITS 0xfffffff8u

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

/* count             rays of this batch, elements in order, D each
 * ray               (n) element * D + bin of each
 * least             least cosine between a ray and the true normal, to which lower rays are lifted
 * triangle          (n) that was hit, -1 for none
 * u, v              (n) barycentrics of the hit
 * distance          (n)
 * bins              (D, 3) local directions
 * start             (N, 3) origins of rays
 * geometric_normal  (N, 3)
 * frames            (N, 3, 3)
 * face_normal       (T, 3)
 * cells, entries, cell_count, near_elements, position: the tables
 * hit               (n) result: links
 */
__kernel void pack_hits(const uint count, __global const uint *ray, const float least, __global const int *triangle,
                        __global const float *u, __global const float *v, __global const float *distance,
                        __global const float *bins, __global const float *start, __global const float *geometric_normal,
                        __global const float *frames, __global const float *face_normal, __global const uint *cells,
                        __global const uint *entries, const uint cell_count, __global const uint *near_elements,
                        __global const float *position, __global uint *hit)
{
    uint r = get_global_id(0);
    if (r >= count) return;
    int escapes = triangle[r] < 0;
    size_t t = escapes ? 0 : triangle[r], i = ray[r] / D_BINS, d = ray[r] % D_BINS;

    // The ray's direction w.
    __global const float *f = frames + 9 * i, *g = geometric_normal + 3 * i, *l = bins + 3 * d;
    float x = l[0] * f[0] + l[1] * f[3] + l[2] * f[6];
    float y = l[0] * f[1] + l[1] * f[4] + l[2] * f[7];
    float z = l[0] * f[2] + l[1] * f[5] + l[2] * f[8];
    float below = least - (x * g[0] + y * g[1] + z * g[2]);
    below = LARGER(below, 0.0f);
    x += below * g[0]; y += below * g[1]; z += below * g[2];
    float scale = 1.0f / sqrt(x * x + y * y + z * z);
    x *= scale; y *= scale; z *= scale;

    // The element nearest to the hit: its place in the list rides in the last bits of the distance.
    __global const float *n = face_normal + 3 * t;
    int back = x * n[0] + y * n[1] + z * n[2] > 0.0f;
    uint entry = entry_of_point(cells, entries, cell_count, t, u[r], v[r], back);
    int blocked = entry == NO_ENTRY;
    __global const uint *list = near_elements + (size_t)(blocked ? 0 : entry) * PER_ENTRY;
    __global const float *o = start + 3 * i;
    float s = escapes ? 0.0f : distance[r];
    float px = o[0] + s * x, py = o[1] + s * y, pz = o[2] + s * z;
    uint nearest_key = 0xffffffffu;
    for (uint k = 0; k < COMPARED; k++) {
        uint key = (as_uint(gap2_of(position, list[k], px, py, pz)) & DISTANCE_BITS) | k;
        nearest_key = LESSER(key, nearest_key);
    }
    uint e = list[nearest_key & ~DISTANCE_BITS];

    // The bin that points back along the ray.
    __global const float *q = frames + 9 * (size_t)e;
    uint bin = bin_of_lane(-(x * q[0] + y * q[1] + z * q[2]), -(x * q[3] + y * q[4] + z * q[5]),
                           -(x * q[6] + y * q[7] + z * q[8]));
    uint link = blocked ? BLOCKED : LINK(e, bin);
    hit[r] = escapes ? ESCAPES : link;
}
