/* live_records.cl: what the kernels of the live picture share.  Device twin of usdslf/render/live/records.py, whose build
 * constants say where things stand in a row: of a surface, a material, a reference to a texture, a source of light.
 */
#include "reflectance.cl"
#include "lookup.cl"

#define TURN 6.283185307f

/* Comparisons and a root in the place of max, min, clamp and normalize, which are calls on some devices. */
#define OVERLOADED inline __attribute__((overloadable))
OVERLOADED float larger(float a, float b) { return a > b ? a : b; }
OVERLOADED float lesser(float a, float b) { return a < b ? a : b; }
OVERLOADED int larger(int a, int b) { return a > b ? a : b; }
OVERLOADED int lesser(int a, int b) { return a < b ? a : b; }
OVERLOADED float3 larger(float3 a, float b) { return (float3)(larger(a.x, b), larger(a.y, b), larger(a.z, b)); }
OVERLOADED float3 lesser(float3 a, float3 b) { return (float3)(lesser(a.x, b.x), lesser(a.y, b.y), lesser(a.z, b.z)); }
OVERLOADED float3 lesser(float3 a, float b) { return (float3)(lesser(a.x, b), lesser(a.y, b), lesser(a.z, b)); }
OVERLOADED float within(float x, float low, float high) { return lesser(larger(x, low), high); }
OVERLOADED int within(int x, int low, int high) { return lesser(larger(x, low), high); }
OVERLOADED float3 within(float3 x, float low, float high) { return lesser(larger(x, low), high); }
inline float3 unit(float3 v) { return v * (1.0f / sqrt(v.x * v.x + v.y * v.y + v.z * v.z)); }
inline float inner(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline float size_of(float3 v) { return sqrt(inner(v, v)); }

/* cosine and sine of 2 pi x for x of [0, 1): polynomials, since a device's own are slow on processors */
inline float2 cos_sin_of_turn(float x)
{
    float q = 4.0f * x;
    int k = (int)(q + 0.5f);
    float a = (q - (float)k) * (0.25f * TURN); /* within an eighth of a turn */
    float a2 = a * a;
    float s = a * (1.0f + a2 * (-0.16666667f + a2 * (8.3333310e-3f + a2 * -1.9840874e-4f)));
    float c = 1.0f + a2 * (-0.5f + a2 * (4.1666638e-2f + a2 * (-1.3888378e-3f + a2 * 2.4760495e-5f)));
    float2 even = (k & 1) ? (float2)(-s, c) : (float2)(c, s);
    return (k & 2) ? -even : even;
}

/* atan2(y, x) in turns, -.5 .. .5; within 1e-6 */
inline float turn_of(float y, float x)
{
    float ax = fabs(x), ay = fabs(y);
    float big = ax > ay ? ax : ay, small = ax > ay ? ay : ax;
    float a = small / (big > 0.0f ? big : 1.0f), s = a * a;
    float t = a * (0.99997726f + s * (-0.33262347f + s * (0.19354346f + s * (-0.11643287f + s * (0.05265332f - s * 0.01172120f)))));
    t *= 1.0f / TURN;
    t = ay > ax ? 0.25f - t : t;
    t = x < 0.0f ? 0.5f - t : t;
    return y < 0.0f ? -t : t;
}

/* bin of a local unit direction, as bin_of of common.cl without calls */
inline int quick_bin_of(float3 l)
{
    float z = l.z > 0.0f ? l.z : 0.0f;
    float up = 1.0f - z, r = sqrt(up > 0.0f ? up : 0.0f);
    float ax = fabs(l.x), ay = fabs(l.y);
    int wide = ax > ay;
    float big = wide ? ax : ay, small = wide ? ay : ax;
    float a = small / (big > 0.0f ? big : 1.0f), s = a * a;
    float t = a * (0.99997726f + s * (-0.33262347f + s * (0.19354346f + s * (-0.11643287f + s * (0.05265332f - s * 0.01172120f)))));
    float second = r * (4.0f / PI_F) * t;
    float x = wide ? r : second, y = wide ? second : r;
    x = l.x < 0.0f ? -x : x;
    y = l.y < 0.0f ? -y : y;
    int i = (int)((x + 1.0f) * (0.5f * SIDE)), j = (int)((y + 1.0f) * (0.5f * SIDE));
    i = i < SIDE - 1 ? i : SIDE - 1;
    j = j < SIDE - 1 ? j : SIDE - 1;
    return j * SIDE + i;
}

inline float largest(float3 c) { return larger(larger(c.x, c.y), c.z); }
inline float bright(float3 c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }
inline float3 row3(__global const float *row, int at) { return (float3)(row[at], row[at + 1], row[at + 2]); }
inline void put3(float3 v, __global float *row, int at) { row[at] = v.x; row[at + 1] = v.y; row[at + 2] = v.z; }

/* a random number of [0, 1) that the state makes */
inline float random(uint *state)
{
    uint s = *state;
    *state = s * 747796405u + 2891336453u;
    uint w = ((s >> ((s >> 28) + 4u)) ^ s) * 277803737u;
    w = (w >> 22) ^ w;
    return (float)(w >> 8) * 0x1p-24f;
}

/* radiance that a surface's colours make of the columns of light X, Y, A, B and coat */
inline float3 of_columns(__global const float *surface, float3 x, float3 y, float3 a, float3 b, float3 coat)
{
    float3 d = row3(surface, DIFFUSE), f0 = row3(surface, F_ZERO), f90 = row3(surface, F_NINETY);
    return d * ((1.0f - f0) * x + (1.0f - f90) * y) + f0 * a + f90 * b + coat;
}

/* the same of weights (5), the columns of light of radiance 1 */
inline float3 reflected(__global const float *surface, const float *w)
{
    return of_columns(surface, (float3)(w[0]), (float3)(w[1]), (float3)(w[2]), (float3)(w[3]), (float3)(w[4]));
}

/* what surfaces send along a ray; a ray of a wide lobe brings at most RAY_MOST of what arrives at its element on average
 * arriving (N): of the elements */
inline float3 held_back(__global const float *ray, float3 bounced, __global const float *arriving)
{
    if (!(ray[RAY_ELEMENT] >= 0.0f)) return bounced;
    float brings = bright(bounced) * ray[RAY_MATTE], most = RAY_MOST * arriving[(int)ray[RAY_ELEMENT]];
    return brings > most ? bounced * (most / brings) : bounced;
}

/* what blend_at of lookup.cl gives, without moving names about: the weights (PER_ENTRY), which sum to 1, of the elements of an entry, of
 * which BLEND at most are not 0.  Only the fifth smallest distance has to be known; returns 0 on a side without elements */
inline int weights_at(__global const float *corners, __global const uint *near_elements, __global const float *position,
                      const uint entry, size_t t, float u, float v, float *weight)
{
    if (entry == NO_ENTRY) return 0;
    __global const uint *list = near_elements + (size_t)entry * PER_ENTRY;
    float3 p0 = load3(corners, 3 * t), p1 = load3(corners, 3 * t + 1), p2 = load3(corners, 3 * t + 2);
    float3 p = p0 + u * (p1 - p0) + v * (p2 - p0);
    float s[PER_ENTRY];
    uint first = list[0];
    for (int k = 0; k < PER_ENTRY; k++) {
        float d2 = gap2_of(position, list[k], p.x, p.y, p.z);
        s[k] = weight[k] = k > 0 && list[k] == first ? INFINITY : d2;
    }
#define ORDER(a, b) { float low = lesser(s[a], s[b]), high = larger(s[a], s[b]); s[a] = low; s[b] = high; }
    ORDER(0, 1) ORDER(2, 3) ORDER(4, 5) ORDER(6, 7) ORDER(0, 2) ORDER(1, 3) ORDER(4, 6) ORDER(5, 7) ORDER(1, 2) ORDER(5, 6)
    ORDER(0, 4) ORDER(1, 5) ORDER(2, 6) ORDER(3, 7) ORDER(2, 4) ORDER(3, 5) ORDER(1, 2) ORDER(3, 4) ORDER(5, 6)
    float reach2 = s[BLEND];
    if (reach2 == INFINITY) { /* fewer: twice the last distance */
        float last = s[0];
        for (int k = 1; k < BLEND; k++) last = s[k] < INFINITY ? s[k] : last;
        reach2 = 4.0f * last;
    }
    reach2 = larger(reach2, 1e-37f);
    float sum = 0.0f, nearest = s[0], scale = 1.0f / reach2;
    for (int k = 0; k < PER_ENTRY; k++) {
        float f = 1.0f - lesser(weight[k] * scale, 1.0f), w = f * f;
        w = weight[k] == nearest ? larger(w, 1e-6f) : w;
        weight[k] = w;
        sum += w;
    }
    scale = 1.0f / sum;
    for (int k = 0; k < PER_ENTRY; k++) weight[k] *= scale;
    return 1;
}
