/* live_surfaces.cl: surfaces at hits, turned to who looks at them; device twin of surfaces/surface_points.py and of
 * render/live/host_surfaces.py.
 */
#include "live_materials.cl"
#include "lookup.cl"

inline float3 unit_or(float3 v, float3 otherwise)
{
    float l = size_of(v);
    return l > 1e-20f && isfinite(l) ? v / l : otherwise;
}

/* tangent-space normal x of a map; stays where texture coordinates have no area */
inline float3 mapped_normal(__global const float *ref, float3 x, __global const float *uvs, const uint triangles,
                            __global const float *corners, size_t t, float3 n)
{
    __global const float *c = uvs + ((size_t)ref[REF_SET] * triangles + t) * 6;
    float a1 = c[2] - c[0], b1 = c[3] - c[1], a2 = c[4] - c[0], b2 = c[5] - c[1];
    float m0 = ref[REF_MATRIX], m1 = ref[REF_MATRIX + 1], m3 = ref[REF_MATRIX + 3], m4 = ref[REF_MATRIX + 4];
    float s1 = m0 * a1 + m1 * b1, t1 = m3 * a1 + m4 * b1, s2 = m0 * a2 + m1 * b2, t2 = m3 * a2 + m4 * b2;
    float area = s1 * t2 - s2 * t1;
    if (!isfinite(area) || fabs(area) <= 1e-20f) return n;
    float3 p0 = load3(corners, 3 * t);
    float3 e1 = load3(corners, 3 * t + 1) - p0, e2 = load3(corners, 3 * t + 2) - p0;
    float sign = area < 0.0f ? -1.0f : 1.0f;
    float3 dp_ds = (e1 * t2 - e2 * t1) * sign, dp_dt = (e2 * s1 - e1 * s2) * sign;
    float3 tangent = unit_or(dp_ds - n * inner(dp_ds, n), (float3)(0.0f));
    if (inner(tangent, tangent) == 0.0f) return n;
    float3 bitangent = cross(n, tangent);
    if (inner(bitangent, dp_dt) < 0.0f) bitangent = -bitangent;
    return unit_or(x.x * tangent + x.y * bitangent + x.z * n, n);
}

/* what a surface reflects, by the workflow of its material, from its inputs */
typedef struct {
    float3 d, f0, f90, emission;
    float coat, coat_f0, cover; /* cover as of COVER */
} Colors;

inline Colors colors_of(const float *in, __global const float *material)
{
    Colors o;
    float3 base = larger((float3)(in[IN_DIFFUSE], in[IN_DIFFUSE + 1], in[IN_DIFFUSE + 2]), 0.0f);
    float metallic = within(in[IN_METALLIC], 0.0f, 1.0f), ior = larger(in[IN_IOR], 1e-3f);
    float r = (1.0f - ior) / (1.0f + ior), r2 = r * r;
    float3 s = 1.0f + (base - 1.0f) * metallic;
    int is_specular = material[MAT_WORKFLOW] > 0.0f;
    o.d = is_specular ? base : base * (1.0f - metallic);
    o.f0 = is_specular ? within((float3)(in[IN_SPECULAR], in[IN_SPECULAR + 1], in[IN_SPECULAR + 2]), 0.0f, 1.0f)
                       : r2 * s + (s - r2 * s) * metallic;
    o.f90 = is_specular ? (float3)(1.0f) : s;
    float threshold = material[MAT_THRESHOLD];
    float opacity = threshold > 0.0f ? (in[IN_OPACITY] >= threshold ? 1.0f : 0.0f) : within(in[IN_OPACITY], 0.0f, 1.0f);
    int scales_all = threshold > 0.0f || material[MAT_PRESENCE] > 0.0f;
    if (!scales_all) o.d *= opacity;
    o.coat = within(in[IN_COAT], 0.0f, 1.0f);
    o.coat_f0 = r2;
    o.cover = scales_all ? -opacity : opacity;
    o.emission = larger((float3)(in[IN_EMISSION], in[IN_EMISSION + 1], in[IN_EMISSION + 2]), 0.0f);
#if !HAS_FRESNEL
    o.d = lesser(o.d, 1.0f);
    o.f0 = lesser(o.f0, 1.0f - o.d);
    o.f90 = 0.0f;
    o.coat = 0.0f;
#endif
    return o;
}

inline void put_colors(Colors c, __global float *out)
{
    put3(c.d, out, DIFFUSE);
    put3(c.f0, out, F_ZERO);
    put3(c.f90, out, F_NINETY);
    put3(c.emission, out, EMISSION);
}

/* surfaces of hits, in place of rows (count)
 * triangle, u, v   (n) of hits; -1: none, whose MATERIAL is -1
 * direction        (n, 3) of travel, unit
 * least_roughness  (n) of rays of wide lobes that are followed: smoother surfaces count as this rough
 * normals          (T, 3, 3) of the corners; extent (T): largest coordinate
 * materials (M, MAT), refs, images, texels, uvs: see live_materials.cl
 * cells .. position: tables of lookup.cl
 * surface          (n, SURFACE) result
 */
__kernel void surfaces_at_hits(
    const uint count, __global const uint *rows, __global const int *triangle, __global const float *u_of,
    __global const float *v_of, __global const float *direction, __global const float *least_roughness,
    const uint triangles, __global const float *corners, __global const float *normals, __global const float *face_normal,
    __global const int *material_of, __global const float *extent,
    __global const float *materials, __global const float *refs, __global const int *images, __global const float4 *texels,
    __global const float *uvs,
    __global const uint *cells, __global const uint *entries, const uint cell_count, __global const uint *near_elements,
    const uint elements, __global float *surface)
{
    size_t at = get_global_id(0);
    if (at >= count) return;
    size_t i = rows[at];
    __global float *out = surface + i * SURFACE;
    int hit = triangle[i];
    if (hit < 0) {
        for (int k = 0; k < SURFACE; k++) out[k] = 0.0f;
        out[MATERIAL] = -1.0f;
        out[ELEMENT] = -1.0f;
        return;
    }
    size_t t = hit;
    float u = u_of[i], v = v_of[i], w = 1.0f - u - v;
    float3 position = w * load3(corners, 3 * t) + u * load3(corners, 3 * t + 1) + v * load3(corners, 3 * t + 2);
    float3 geometric = load3(face_normal, t);
    float3 normal = w * load3(normals, 3 * t) + u * load3(normals, 3 * t + 1) + v * load3(normals, 3 * t + 2);
    normal = unit_or(normal, geometric);
    if (inner(normal, geometric) < 0.0f) normal = -normal;
    int m = material_of[t];
    __global const float *material = materials + m * MAT;
    float in[INPUTS];
    inputs_at(material, refs, images, texels, uvs, triangles, t, u, v, in);
    int bump = (int)material[MAT_NORMAL];
    if (bump >= 0) {
        float4 x = texture_at(refs + bump * REF, images, texels, uvs, triangles, t, u, v);
        normal = mapped_normal(refs + bump * REF, x.xyz, uvs, triangles, corners, t, normal);
    }

    Colors colors = colors_of(in, material);
    float roughness = within(in[IN_ROUGHNESS], 0.001f, 1.0f);
    float coat_roughness = within(in[IN_COAT_ROUGHNESS], 0.001f, 1.0f);
    roughness = larger(roughness, least_roughness[i]);

    /* turned to the viewer; a shading normal that is not seen is bent until it is just so */
    float3 view = -load3(direction, i);
    int back = inner(geometric, view) < 0.0f;
    if (back) { geometric = -geometric; normal = -normal; }
    float least = lesser(0.02f, larger(inner(geometric, view), 1e-3f));
    normal += 1.5f * larger(least - inner(normal, view), 0.0f) * view;
    normal /= larger(size_of(normal), 1e-12f);

    uint entry = entry_of_point(cells, entries, cell_count, hit, u, v, back);
    uint element = entry == NO_ENTRY || elements == 0 ? NO_ENTRY : near_elements[(size_t)entry * PER_ENTRY];
    put3(position, out, POSITION);
    put3(normal, out, NORMAL);
    put3(geometric, out, GEOMETRIC);
    put3(view, out, VIEW);
    put_colors(colors, out);
    out[ALPHA] = larger(roughness * roughness, MIN_ALPHA);
    out[COAT_ALPHA] = larger(coat_roughness * coat_roughness, MIN_ALPHA);
    out[COAT] = colors.coat;
    out[COAT_F_ZERO] = colors.coat_f0;
    out[LIFT] = OFFSET * larger(extent[t], largest(fabs(position)));
    out[MATERIAL] = (float)m;
    out[ELEMENT] = element == NO_ENTRY ? -1.0f : (float)element;
    out[COVER] = colors.cover;
}

/* colours alone of surfaces that have another one; arguments as above */
__kernel void recolor(
    const uint count, __global const uint *rows, __global const int *triangle, __global const float *u_of,
    __global const float *v_of, const uint triangles, __global const int *material_of, __global const float *materials,
    __global const float *refs, __global const int *images, __global const float4 *texels, __global const float *uvs,
    __global float *surface)
{
    size_t at = get_global_id(0);
    if (at >= count) return;
    size_t i = rows[at], t = triangle[i];
    __global const float *material = materials + material_of[t] * MAT;
    float in[INPUTS];
    inputs_at(material, refs, images, texels, uvs, triangles, t, u_of[i], v_of[i], in);
    put_colors(colors_of(in, material), surface + i * SURFACE);
}

/* diffuse light from the light field, by the elements about each row
 * irradiance (N, 3) over pi; soft (n, 3) result; directions, rows and tables as above */
__kernel void soft_light(
    const uint count, __global const int *triangle, __global const float *u_of, __global const float *v_of,
    __global const float *direction, __global const float *corners, __global const float *face_normal,
    __global const uint *cells, __global const uint *entries, const uint cell_count, __global const uint *near_elements,
    __global const float *position, __global const float *irradiance, __global float *soft)
{
    /* without branches, so that work-items ride in lanes; one beyond the end does what the last one does, and writes nothing */
    uint i = get_global_id(0), at = i < count ? i : count - 1;
    int is_there = triangle[at] >= 0;
    size_t t = is_there ? triangle[at] : 0;
    float u = is_there ? u_of[at] : 0.0f, v = is_there ? v_of[at] : 0.0f;
    __global const float *d = direction + 3 * (size_t)at, *n = face_normal + 3 * t, *c = corners + 9 * t;
    uint entry = entry_of_point(cells, entries, cell_count, t, u, v, d[0] * n[0] + d[1] * n[1] + d[2] * n[2] > 0.0f);
    is_there &= entry != NO_ENTRY;
    Triple p = triple(c[0] + u * (c[3] - c[0]) + v * (c[6] - c[0]), c[1] + u * (c[4] - c[1]) + v * (c[7] - c[1]),
                      c[2] + u * (c[5] - c[2]) + v * (c[8] - c[2]));
    Blend o = blend_of_list(position, near_elements + (size_t)(is_there ? entry : 0) * PER_ENTRY, p);
    __global const float *ea = irradiance + 3 * o.a, *eb = irradiance + 3 * o.b;
    __global const float *ec = irradiance + 3 * o.c, *ed = irradiance + 3 * o.d;
    Triple sum = triple(o.wa * ea[0] + o.wb * eb[0] + o.wc * ec[0] + o.wd * ed[0],
                        o.wa * ea[1] + o.wb * eb[1] + o.wc * ec[1] + o.wd * ed[1],
                        o.wa * ea[2] + o.wb * eb[2] + o.wc * ec[2] + o.wd * ed[2]);
    sum = times(is_there ? 1.0f : 0.0f, sum);
    if (i >= count) return;
    put3(sum, soft, 3 * i);
}
