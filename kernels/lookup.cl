/* lookup.cl: the elements near a point of the scene, in constant time.  Device twin of usdslf/element_lookup.py.
 *
 *     cell (i, j, upper) of (u, v):  i = floor(u n), j = floor(v n), upper: frac(u n) + frac(v n) > 1
 *     its number:                    i (2 n - i) + 2 j + upper
 *     weight of an element:          (1 - (d / R)^2)^2, R the distance of the fifth nearest
 */
#include "common.cl"

#define NO_ENTRY 0xffffffffu
#ifndef NEAR
#define NEAR 8   /* elements an entry names */
#endif
#define BLEND 4  /* of them are blended */

/* cells (T, 2) first cell and divisions; entries (2, cell_count) front and back */
inline uint entry_of_point(__global const uint *cells, __global const uint *entries, uint cell_count, int triangle, float u,
                           float v, int back)
{
    uint2 c = vload2(triangle, cells);
    int n = c.y;
    float x = fmax(u, 0.0f) * n, y = fmax(v, 0.0f) * n;
    int i = min((int)x, n - 1);
    int j = min((int)y, n - 1 - i);
    int upper = (x - i) + (y - j) > 1.0f && j < n - 1 - i;
    return entries[(size_t)back * cell_count + c.x + i * (2 * n - i) + 2 * j + upper];
}

/* the element of an entry that is nearest to a point; near_elements (entries, NEAR), position (N, 3) */
inline uint nearest_of_entry(__global const uint *near_elements, __global const float *position, uint entry, float3 point)
{
    __global const uint *list = near_elements + (size_t)entry * NEAR;
    uint best = list[0];
    float3 gap = load3(position, best) - point;
    float least = dot(gap, gap);
    for (int k = 1; k < NEAR; k++) {
        uint e = list[k];
        if (e == NO_ENTRY) break;
        gap = load3(position, e) - point;
        float d2 = dot(gap, gap);
        if (d2 < least) { least = d2; best = e; }
    }
    return best;
}

/* near elements of points and the weights that blend them
 * count          points
 * triangle       (n)
 * barycentric    (n, 2)
 * back           (n) 1 on the back
 * corners        (T, 3, 3)
 * cells, entries, near_elements, position: the tables
 * element        (n, 4) result, nearest first, repeated where there are fewer
 * weight         (n, 4) result, sums to 1, or all 0 on a side without elements
 */
__kernel void nearest(const uint count, __global const int *triangle, __global const float *barycentric,
                      __global const uchar *back, __global const float *corners, __global const uint *cells,
                      __global const uint *entries, const uint cell_count, __global const uint *near_elements,
                      __global const float *position, __global int *element, __global float *weight)
{
    size_t r = get_global_id(0);
    if (r >= count) return;
    int t = triangle[r];
    float2 uv = vload2(r, barycentric);
    uint entry = entry_of_point(cells, entries, cell_count, t, uv.x, uv.y, back[r]);
    if (entry == NO_ENTRY) {
        vstore4((int4)(0), r, element);
        vstore4((float4)(0.0f), r, weight);
        return;
    }
    float3 p0 = load3(corners, 3 * (size_t)t);
    float3 point = p0 + uv.x * (load3(corners, 3 * (size_t)t + 1) - p0) + uv.y * (load3(corners, 3 * (size_t)t + 2) - p0);

    // The five nearest, by insertion.
    __global const uint *list = near_elements + (size_t)entry * NEAR;
    uint who[BLEND + 1];
    float far[BLEND + 1];
    for (int k = 0; k <= BLEND; k++) { who[k] = list[0]; far[k] = INFINITY; }
    for (int k = 0; k < NEAR; k++) {
        uint e = list[k];
        if (e == NO_ENTRY) break;
        float3 gap = load3(position, e) - point;
        float d2 = dot(gap, gap);
        for (int m = 0; m <= BLEND; m++) {
            int closer = d2 < far[m];
            float fd = far[m];
            uint fe = who[m];
            far[m] = closer ? d2 : fd;
            who[m] = closer ? e : fe;
            d2 = closer ? fd : d2;
            e = closer ? fe : e;
        }
    }
    // Weights that fall smoothly to zero at the fifth; where there are fewer, at twice the last distance.
    float last = 0.0f;
    for (int k = 0; k < BLEND; k++) last = isinf(far[k]) ? last : far[k];
    float reach2 = fmax(isinf(far[BLEND]) ? 4.0f * last : far[BLEND], 1e-37f);
    float w[BLEND], sum = 0.0f;
    for (int k = 0; k < BLEND; k++) {
        float f = 1.0f - fmin(far[k] / reach2, 1.0f);
        w[k] = f * f;
        if (k == 0) w[k] = fmax(w[k], 1e-6f);
        sum += w[k];
    }
    for (int k = 0; k < BLEND; k++) {
        element[r * BLEND + k] = who[k];
        weight[r * BLEND + k] = w[k] / sum;
    }
}
