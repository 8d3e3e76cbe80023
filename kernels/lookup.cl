/* lookup.cl: the elements near a point of the scene, in constant time.  Device twin of usdslf/elements/lookup.py.
 *
 *     cell (i, j, upper) of (u, v):  i = floor(u n), j = floor(v n), upper: frac(u n) + frac(v n) > 1
 *     its number:                    i (2 n - i) + 2 j + upper
 *     weight of an element:          (1 - (d / R)^2)^2, R the distance of the fifth nearest
 *
 * Comparisons and not fmin and fmax, which are calls on some devices and keep work-items from riding in lanes.
 */
#include "common.cl"

#define NO_ENTRY 0xffffffffu
#define PER_ENTRY 8   /* elements an entry names; the first again where there are fewer */
#define BLEND 4  /* of them are blended */
#define LESSER(a, b) ((a) < (b) ? (a) : (b))
#define LARGER(a, b) ((a) > (b) ? (a) : (b))

/* cells (T, 2) first cell and divisions; entries (2, cell_count) front and back */
inline uint entry_of_point(__global const uint *cells, __global const uint *entries, uint cell_count, int triangle, float u,
                           float v, int back)
{
    uint first = cells[2 * (size_t)triangle];
    int n = cells[2 * (size_t)triangle + 1];
    float x = LARGER(u, 0.0f) * n, y = LARGER(v, 0.0f) * n;
    int i = LESSER((int)x, n - 1);
    int j = LESSER((int)y, n - 1 - i);
    int upper = ((x - i) + (y - j) > 1.0f) & (j < n - 1 - i);
    return entries[back * cell_count + first + i * (2 * n - i) + 2 * j + upper];
}

/* squared distance from a point (x, y, z) to an element */
inline float gap2_of(__global const float *position, uint e, float x, float y, float z)
{
    __global const float *p = position + 3 * (size_t)e;
    float dx = p[0] - x, dy = p[1] - y, dz = p[2] - z;
    return dx * dx + dy * dy + dz * dz;
}

/* the BLEND elements near a point of a triangle, nearest first and repeated where there are fewer, and the weights that
 * blend them; all weights are 0 on a side without elements */
inline void blend_at(__global const float *corners, __global const uint *cells, __global const uint *entries,
                     uint cell_count, __global const uint *near_elements, __global const float *position, size_t t,
                     float u, float v, int back, uint *who, float *weight)
{
    uint entry = entry_of_point(cells, entries, cell_count, t, u, v, back);
    int dead = entry == NO_ENTRY;
    __global const uint *list = near_elements + (size_t)(dead ? 0 : entry) * PER_ENTRY;
    float3 p0 = load3(corners, 3 * t);
    float3 p = p0 + u * (load3(corners, 3 * t + 1) - p0) + v * (load3(corners, 3 * t + 2) - p0);

    // The five nearest, by insertion.
    float far[BLEND + 1];
    for (int k = 0; k <= BLEND; k++) { who[k] = list[0]; far[k] = INFINITY; }
    for (int k = 0; k < PER_ENTRY; k++) {
        uint e = list[k];
        float d2 = k > 0 && e == list[0] ? INFINITY : gap2_of(position, e, p.x, p.y, p.z);
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
    float last = 0.0f, sum = 0.0f;
    for (int k = 0; k < BLEND; k++) last = isinf(far[k]) ? last : far[k];
    float reach2 = isinf(far[BLEND]) ? 4.0f * last : far[BLEND];
    reach2 = LARGER(reach2, 1e-37f);
    for (int k = 0; k < BLEND; k++) {
        float ratio = far[k] / reach2;
        float f = 1.0f - LESSER(ratio, 1.0f);
        weight[k] = f * f;
        if (k == 0) weight[k] = LARGER(weight[k], 1e-6f);
        sum += weight[k];
    }
    for (int k = 0; k < BLEND; k++) weight[k] = dead ? 0.0f : weight[k] / sum;
}
