/* live_records.cl: what the kernels of the live picture share.  Device twin of usdslf/render/live/records.py, whose build
 * constants say where things stand in a row: of a surface, a material, a reference to a texture, a source of light.
 */
/* All functions are put into the kernels, but for a simulator that knows no such code (CALLS): calls keep what they take
 * and give in memory, which takes a fifth longer.  PoCL has made the word a macro of nothing. */
#ifndef CALLS
#undef inline
#define inline inline __attribute__((always_inline))
#endif
#include "reflectance.cl"
#include "lookup.cl"

#define WEIGHTS 5 /* of a direction: those of X, Y, A, B and coat */
#define TURN 6.283185307f
#define NONE_SO_FAR 1e38f
#define IS_FOLLOWED 0xfffffffeu /* in the place of an entry: the light field does not answer this ray */

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
OVERLOADED float3 unit(float3 v) { return v * (1.0f / sqrt(v.x * v.x + v.y * v.y + v.z * v.z)); }
OVERLOADED float inner(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline float size_of(float3 v) { return sqrt(inner(v, v)); }

/* three numbers, and no vector: compilers put work-items into lanes only where their numbers are not in vectors already */
typedef struct {
    float x, y, z;
} Triple;

OVERLOADED Triple triple(float x, float y, float z)
{
    Triple v = {x, y, z};
    return v;
}
OVERLOADED Triple triple(float3 v) { return triple(v.x, v.y, v.z); }
OVERLOADED Triple triple(__global const float *row, int at) { return triple(row[at], row[at + 1], row[at + 2]); }
inline float3 vector(Triple v) { return (float3)(v.x, v.y, v.z); }
inline Triple plus(Triple a, Triple b) { return triple(a.x + b.x, a.y + b.y, a.z + b.z); }
inline Triple times(float s, Triple v) { return triple(s * v.x, s * v.y, s * v.z); }
OVERLOADED float inner(Triple a, Triple b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
OVERLOADED Triple unit(Triple v) { return times(1.0f / sqrt(inner(v, v)), v); }

/* cosine and sine of 2 pi x for x of [0, 1): polynomials, since a device's own are slow on processors */
inline float2 cos_sin_of_turn(float x)
{
    float q = 4.0f * x;
    int k = (int)(q + 0.5f);
    float a = (q - (float)k) * (0.25f * TURN); /* within an eighth of a turn */
    float a2 = a * a;
    float s = a * (1.0f + a2 * (-0.16666667f + a2 * (8.3333310e-3f + a2 * -1.9840874e-4f)));
    float c = 1.0f + a2 * (-0.5f + a2 * (4.1666638e-2f + a2 * (-1.3888378e-3f + a2 * 2.4760495e-5f)));
    float u = (k & 1) ? -s : c, v = (k & 1) ? c : s;
    return (float2)((k & 2) ? -u : u, (k & 2) ? -v : v);
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

/* bins of local unit directions, as bin_of of common.cl without calls; F, I: one or four of them side by side */
#define DEFINE_BIN_OF(F, I, TO_I)                                                                              \
    OVERLOADED I quick_bin_of(F x, F y, F z)                                                                               \
    {                                                                                                                      \
        F up = 1.0f - (z > 0.0f ? z : 0.0f), r = sqrt(up > 0.0f ? up : 0.0f);                                              \
        F ax = fabs(x), ay = fabs(y);                                                                                      \
        F big = ax > ay ? ax : ay, small = ax > ay ? ay : ax;                                                              \
        F a = small / (big > 0.0f ? big : 1.0f), s = a * a;                                                                \
        F t = a * (0.99997726f + s * (-0.33262347f + s * (0.19354346f + s * (-0.11643287f                                  \
                   + s * (0.05265332f - s * 0.01172120f)))));                                                              \
        F second = r * (4.0f / PI_F) * t;                                                                                  \
        F u = ax > ay ? r : second, v = ax > ay ? second : r;                                                              \
        I i = TO_I(((x < 0.0f ? -u : u) + 1.0f) * (0.5f * SIDE)), j = TO_I(((y < 0.0f ? -v : v) + 1.0f) * (0.5f * SIDE));  \
        i = i < SIDE - 1 ? i : SIDE - 1;                                                                                   \
        j = j < SIDE - 1 ? j : SIDE - 1;                                                                                   \
        return j * SIDE + i;                                                                                               \
    }
DEFINE_BIN_OF(float, int, (int))
DEFINE_BIN_OF(float4, int4, convert_int4)
OVERLOADED int quick_bin_of(float3 l) { return quick_bin_of(l.x, l.y, l.z); }

/* whether a ray's footprint is too small for the light field to answer it; facing: cosine at the hit, of any sign */
inline int is_footprint_fine(const float least_footprint, float facing, float distance, float pdf)
{
    float cosine = facing < 0.0f ? -facing : facing;
    return distance * distance / larger(pdf * larger(cosine, 0.05f), 1e-6f) < least_footprint;
}

OVERLOADED float largest(float3 c) { return larger(larger(c.x, c.y), c.z); }
OVERLOADED float largest(Triple c) { return larger(larger(c.x, c.y), c.z); }
OVERLOADED float bright(float3 c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }
OVERLOADED float bright(Triple c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }
inline float3 row3(__global const float *row, int at) { return (float3)(row[at], row[at + 1], row[at + 2]); }
OVERLOADED void put3(float3 v, __global float *row, int at) { row[at] = v.x; row[at + 1] = v.y; row[at + 2] = v.z; }
OVERLOADED void put3(Triple v, __global float *row, int at) { row[at] = v.x; row[at + 1] = v.y; row[at + 2] = v.z; }

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

/* what surfaces send along a ray; a ray of a wide lobe brings at most RAY_MOST of what arrives at its element on average
 * element, matte: RAY_ELEMENT and RAY_MATTE of the ray; arriving (N): of the elements */
inline float3 held_back(float element, float matte, float3 bounced, __global const float *arriving)
{
    if (!(element >= 0.0f)) return bounced;
    float brings = bright(bounced) * matte, most = RAY_MOST * arriving[(int)element];
    return brings > most ? bounced * (most / brings) : bounced;
}

/* what blend_at of lookup.cl gives: four elements, nearest first, and their weights */
typedef struct {
    uint a, b, c, d;
    float wa, wb, wc, wd;
} Blend;

/* squared distance from p to the k-th element of a list, and in its last bits k; a first one that is named again is far away */
inline uint near_key(__global const float *position, __global const uint *list, uint k, Triple p)
{
    uint e = list[k];
    float gap2 = gap2_of(position, e, p.x, p.y, p.z);
    gap2 = ((k > 0u) & (e == list[0])) ? NONE_SO_FAR : gap2;
    return (as_uint(gap2) & ~(PER_ENTRY - 1u)) | k;
}

/* the elements near point p, of an entry's list; numbers alone and no vectors, and put in order one by one, so that work-items
 * ride in lanes */
inline Blend blend_of_list(__global const float *position, __global const uint *list, Triple p)
{
    uint a = near_key(position, list, 0, p), none = (as_uint(NONE_SO_FAR) & ~(PER_ENTRY - 1u)) | (PER_ENTRY - 1u);
    uint b = none, c = none, d = none, e = none;
    #pragma unroll
    for (uint k = 1; k < PER_ENTRY; k++) {
        uint key = near_key(position, list, k, p), more = LARGER(a, key);
        a = LESSER(a, key);
        key = LARGER(b, more);
        b = LESSER(b, more);
        more = LARGER(c, key);
        c = LESSER(c, key);
        key = LARGER(d, more);
        d = LESSER(d, more);
        e = LESSER(e, key);
    }
    float s0 = as_float(a), s1 = as_float(b), s2 = as_float(c), s3 = as_float(d), reach2 = as_float(e);
    float far = 0.5f * NONE_SO_FAR, last = s1 < far ? s1 : s0;
    last = s2 < far ? s2 : last;
    last = s3 < far ? s3 : last;
    reach2 = reach2 < far ? reach2 : 4.0f * last; /* fewer: twice the last distance */
    float per = 1.0f / larger(reach2, 1e-37f);
    float fa = larger(1.0f - s0 * per, 0.0f), fb = larger(1.0f - s1 * per, 0.0f);
    float fc = larger(1.0f - s2 * per, 0.0f), fd = larger(1.0f - s3 * per, 0.0f);
    fa = larger(fa * fa, 1e-6f);
    fb *= fb;
    fc *= fc;
    fd *= fd;
    float share = 1.0f / (fa + fb + fc + fd);
    uint mask = PER_ENTRY - 1u;
    Blend o = {list[a & mask], list[b & mask], list[c & mask], list[d & mask], fa * share, fb * share, fc * share, fd * share};
    return o;
}

/* the same in an entry, as vectors; returns 0 on a side without elements */
inline int weights_at(__global const uint *near_elements, __global const float *position, const uint entry, float3 p, uint4 *who,
                      float4 *weight)
{
    if (entry == NO_ENTRY) return 0;
    Blend o = blend_of_list(position, near_elements + (size_t)entry * PER_ENTRY, triple(p));
    *who = (uint4)(o.a, o.b, o.c, o.d);
    *weight = (float4)(o.wa, o.wb, o.wc, o.wd);
    return 1;
}
