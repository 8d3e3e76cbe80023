/* live_materials.cl: inputs of materials at points of triangles, constant or from textures.
 *
 *     value = bilinear(texels, st) * scale + bias
 *
 * Device twin of textures/texels.py and of evaluate_surface of surfaces/surface_points.py.  Texels are decoded float4.
 */
#include "live_records.cl"

#define BLACK 0
#define REPEAT 2
#define MIRROR 3
#define OUTSIDE 1e-5f /* st this far outside 0..1 still counts as inside for wrap mode black */

inline float wrapped(float s, int wrap, int *inside)
{
    if (wrap == REPEAT) return s - floor(s);
    if (wrap == MIRROR) return 1.0f - fabs(1.0f - (s - 2.0f * floor(0.5f * s)));
    if (wrap == BLACK) *inside &= (s >= -OUTSIDE) & (s <= 1.0f + OUTSIDE);
    return within(s, 0.0f, 1.0f);
}

inline int texel_beside(int i, int size, int wrap)
{
    if (wrap == REPEAT) return i < 0 ? i + size : i >= size ? i - size : i;
    return within(i, 0, size - 1);
}

/* texel * scale + bias at a point (u, v) of triangle t
 * ref: a row of references; images (images, 3) first texel, width, height; uvs (sets, T, 3, 2) */
inline float4 texture_at(__global const float *ref, __global const int *images, __global const float4 *texels,
                         __global const float *uvs, const uint triangles, size_t t, float u, float v)
{
    __global const float *c = uvs + ((size_t)ref[REF_SET] * triangles + t) * 6;
    float w = 1.0f - u - v;
    float s0 = w * c[0] + u * c[2] + v * c[4], t0 = w * c[1] + u * c[3] + v * c[5];
    s0 = isfinite(s0) ? s0 : ref[REF_FALLBACK];
    t0 = isfinite(t0) ? t0 : ref[REF_FALLBACK + 1];
    float s = ref[REF_MATRIX] * s0 + ref[REF_MATRIX + 1] * t0 + ref[REF_MATRIX + 2];
    float r = ref[REF_MATRIX + 3] * s0 + ref[REF_MATRIX + 4] * t0 + ref[REF_MATRIX + 5];
    __global const int *image = images + 3 * (int)ref[REF_IMAGE];
    int width = image[1], height = image[2], wrap_s = (int)ref[REF_WRAP], wrap_t = (int)ref[REF_WRAP + 1];
    int inside = 1;
    float x = wrapped(s, wrap_s, &inside) * width - 0.5f, y = wrapped(1.0f - r, wrap_t, &inside) * height - 0.5f;
    float fx = floor(x), fy = floor(y);
    int x0 = texel_beside((int)fx, width, wrap_s), x1 = texel_beside((int)fx + 1, width, wrap_s);
    int y0 = texel_beside((int)fy, height, wrap_t), y1 = texel_beside((int)fy + 1, height, wrap_t);
    fx = x - fx;
    fy = y - fy;
    __global const float4 *at = texels + image[0];
    float4 upper = at[y0 * width + x0] * (1.0f - fx) + at[y0 * width + x1] * fx;
    float4 lower = at[y1 * width + x0] * (1.0f - fx) + at[y1 * width + x1] * fx;
    float4 value = upper * (1.0f - fy) + lower * fy;
    if (!inside) value = (float4)(0.0f);
    return value * vload4(0, ref + REF_SCALE) + vload4(0, ref + REF_BIAS);
}

/* the inputs (INPUTS) of a material at a point */
inline void inputs_at(__global const float *material, __global const float *refs, __global const int *images,
                      __global const float4 *texels, __global const float *uvs, const uint triangles, size_t t, float u, float v,
                      float *in)
{
    for (int k = 0; k < INPUTS; k++) in[k] = material[k];
    int first = (int)material[MAT_FIRST], last = first + (int)material[MAT_COUNT];
    for (int r = first; r < last; r++) {
        __global const float *ref = refs + r * REF;
        float4 x = texture_at(ref, images, texels, uvs, triangles, t, u, v);
        int to = (int)ref[REF_INPUT], channel = (int)ref[REF_CHANNEL];
        float one = channel == 0 ? x.x : channel == 1 ? x.y : channel == 2 ? x.z : x.w;
        in[to] = channel < 0 ? x.x : one;
        if (ref[REF_SIZE] > 1.0f) {
            in[to + 1] = channel < 0 ? x.y : one;
            in[to + 2] = channel < 0 ? x.z : one;
        }
    }
}

/* what a surface emits */
inline float3 emission_at(__global const float *material, __global const float *refs, __global const int *images,
                          __global const float4 *texels, __global const float *uvs, const uint triangles, size_t t, float u, float v)
{
    float3 e = row3(material, IN_EMISSION);
    if (material[MAT_GLOWS] > 1.0f) { /* from a texture */
        float in[INPUTS];
        inputs_at(material, refs, images, texels, uvs, triangles, t, u, v, in);
        e = (float3)(in[IN_EMISSION], in[IN_EMISSION + 1], in[IN_EMISSION + 2]);
    }
    return larger(e, 0.0f);
}
