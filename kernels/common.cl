/* common.cl: what all kernels share: packed rows of three, frames, the bins of the hemisphere.
 *
 * Device twin of usdslf/sampling/hemisphere.py.  Bin d = iy * SIDE + ix of the equal-area concentric map
 * (Shirley and Chiu 1997); mirroring about the normal is d -> D - 1 - d.
 */
#ifndef SIDE
#define SIDE 32
#endif
#define D_BINS (SIDE * SIDE)
#define PI_F 3.14159265358979f
#define LUMINANCE ((float3)(0.2126f, 0.7152f, 0.0722f)) /* its weights, as in usdslf/color.py */

/* radiance of elements, as it is stored: floats, or with HALF_LIGHT half as wide ones */
#ifndef HALF_LIGHT
#define HALF_LIGHT 0
#endif
#if HALF_LIGHT
typedef half light_t;
#define load_light(rows, i) vload_half3(i, rows)
#define light_at(rows, i) vload_half(i, rows)
#define load_light4(from) vload_half4(0, from)
#define load_light16(from) vload_half16(0, from)
#define store_light(v, rows, i) vstore_half3(v, i, rows)
#define store_light4(v, to) vstore_half4(v, 0, to)
#else
typedef float light_t;
#define load_light(rows, i) vload3(i, rows)
#define light_at(rows, i) ((rows)[i])
#define load_light4(from) vload4(0, from)
#define load_light16(from) vload16(0, from)
#define store_light(v, rows, i) vstore3(v, i, rows)
#define store_light4(v, to) vstore4(v, 0, to)
#endif

inline float3 load3(__global const float *rows, size_t i) { return vload3(i, rows); }
inline void store3(float3 v, __global float *rows, size_t i) { vstore3(v, i, rows); }

inline float sum_lanes(float16 v)
{
    float8 a = v.lo + v.hi;
    float4 b = a.lo + a.hi;
    return b.x + b.y + b.z + b.w;
}

/* world -> local by a frame whose rows are tangent, bitangent, normal */
inline float3 local_from_world(__global const float *frames, size_t i, float3 w)
{
    return (float3)(dot(load3(frames, 3 * i), w), dot(load3(frames, 3 * i + 1), w), dot(load3(frames, 3 * i + 2), w));
}

inline float3 world_from_local(__global const float *frames, size_t i, float3 l)
{
    return l.x * load3(frames, 3 * i) + l.y * load3(frames, 3 * i + 1) + l.z * load3(frames, 3 * i + 2);
}

/* a frame about a unit normal, without a branch (Duff et al. 2017) */
inline void frame_about(float3 n, float3 *t, float3 *b)
{
    float s = copysign(1.0f, n.z);
    float a = -1.0f / (s + n.z);
    float c = n.x * n.y * a;
    *t = (float3)(1.0f + s * n.x * n.x * a, s * c, -s * n.x);
    *b = (float3)(c, s + n.y * n.y * a, -n.y);
}

/* point (a, b) of [-1, 1]^2 -> upper hemisphere */
inline float3 hemisphere_from_square(float a, float b)
{
    int wide = fabs(a) > fabs(b);
    float r = wide ? a : b;
    float safe = r == 0.0f ? 1.0f : r;
    float phi = wide ? 0.25f * PI_F * b / safe : 0.5f * PI_F - 0.25f * PI_F * a / safe;
    float s = r * sqrt(max(2.0f - r * r, 0.0f));
    return (float3)(s * cos(phi), s * sin(phi), 1.0f - r * r);
}

inline float2 square_from_hemisphere(float3 l)
{
    float r = sqrt(clamp(1.0f - l.z, 0.0f, 1.0f));
    int wide = fabs(l.x) > fabs(l.y);
    float big = wide ? l.x : l.y;
    float small = wide ? l.y : l.x;
    float first = big < 0.0f ? -r : r;
    float second = first * (4.0f / PI_F) * atan(small / (big == 0.0f ? 1.0f : big));
    return wide ? (float2)(first, second) : (float2)(second, first);
}

/* bin of a local unit direction; below the horizon: the rim */
inline int bin_of(float3 l)
{
    if (l.z < 0.0f) {
        l.z = 0.0f;
        float n = length(l);
        l = n > 0.0f ? l / n : (float3)(0.0f, 0.0f, 1.0f);
    }
    float2 q = (square_from_hemisphere(l) + 1.0f) * (0.5f * SIDE);
    int x = clamp((int)q.x, 0, SIDE - 1);
    int y = clamp((int)q.y, 0, SIDE - 1);
    return y * SIDE + x;
}

inline float3 bin_direction(int d)
{
    return hemisphere_from_square((d % SIDE + 0.5f) * (2.0f / SIDE) - 1.0f, (d / SIDE + 0.5f) * (2.0f / SIDE) - 1.0f);
}

/* a row of a sharp level: the sums of light (D, 3) times the weights a and b of taps first .. last */
inline void sharp_row(__global const float16 *light, int first, int last, __global const ushort *tap,
                      __global const float *a, __global const float *b, float16 *as, float16 *bs)
{
    for (int c = 0; c < 3; c++) as[c] = bs[c] = 0.0f;
    for (int k = first; k < last; k++) {
        float wa = a[k], wb = b[k];
        float16 r = light[tap[k] * 3], g = light[tap[k] * 3 + 1], bl = light[tap[k] * 3 + 2];
        as[0] += wa * r; as[1] += wa * g; as[2] += wa * bl;
        bs[0] += wb * r; bs[1] += wb * g; bs[2] += wb * bl;
    }
}
