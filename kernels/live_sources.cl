/* live_sources.cl: all that shines, as seen from points: directions drawn towards a source, and what rays meet.
 *
 * Device twin of lights/sampling.py, lights/shapes.py and lights/sources.py, with one difference: flat lights are drawn by their
 * area.  Drawing and meeting know the same density, so what both estimate together is the same.
 */
#include "live_materials.cl"

#define RECT 0
#define DISK 1
#define SPHERE 2
#define CYLINDER 3
#define DISTANT 4
#define POINT 5
#define DOME 6
#define GLOWING 7 /* surfaces that emit */

/* what all functions here need
 * sources (source_count, SOURCE), each of which gets a ray where there are as many `streams`; pictures (texels) of domes and rect lights; tables: densities of domes and where their
 * pixels' rows and columns are in them; drawn (domes, DRAWN, 8) directions of domes: direction, density, radiance;
 * glowing (G) triangles, cumulative (G) their chances, glow_density (T) per area */
#define SCENE_PARAMETERS                                                                                                          \
    const uint triangles, __global const float *corners, __global const float *face_normal, __global const int *material_of,      \
        __global const float *materials, __global const float *refs, __global const int *images, __global const float4 *texels,   \
        __global const float *uvs, const int source_count, const int streams, __global const float *sources, __global const float4 *pictures, __global const float *tables,  \
        __global const float *drawn, const int glowing_count, __global const int *glowing, __global const float *cumulative,      \
        __global const float *glow_density
#define SCENE                                                                                                                     \
    triangles, corners, face_normal, material_of, materials, refs, images, texels, uvs, source_count, streams, sources, pictures, tables, drawn,         \
        glowing_count, glowing, cumulative, glow_density

typedef struct {
    float3 direction; /* towards the light */
    float distance;
    float3 radiance;  /* of a delta light: irradiance at normal incidence */
    float density;    /* 1/sr; 0: nothing arrives */
} Arrival;

inline float3 world_of(__global const float *source, float3 l)
{
    __global const float *m = source + SRC_LINEAR;
    return (float3)(m[0] * l.x + m[1] * l.y + m[2] * l.z, m[3] * l.x + m[4] * l.y + m[5] * l.z, m[6] * l.x + m[7] * l.y + m[8] * l.z);
}

inline float3 local_of(__global const float *source, float3 w)
{
    __global const float *m = source + SRC_INVERSE;
    return (float3)(m[0] * w.x + m[1] * w.y + m[2] * w.z, m[3] * w.x + m[4] * w.y + m[5] * w.z, m[6] * w.x + m[7] * w.y + m[8] * w.z);
}

/* factor of shaping on light that leaves against `direction` */
inline float3 shaped(__global const float *source, float3 direction)
{
    float3 out = (float3)(1.0f);
    if (source[SRC_SHAPING] <= 0.0f) return out;
    float c = within(-inner(row3(source, SRC_AXIS), direction), -1.0f, 1.0f);
    float cutoff = source[SRC_CONE], start = source[SRC_CONE + 1];
    if (cutoff >= 0.0f) {
        float off = acos(c);
        float t = cutoff > start ? within((off - start) / (cutoff - start), 0.0f, 1.0f) : (off <= cutoff ? 0.0f : 1.0f);
        out *= 1.0f - t * t * (3.0f - 2.0f * t);
    }
    if (source[SRC_FOCUS] > 0.0f) {
        float3 tint = row3(source, SRC_TINT);
        out *= tint + (1.0f - tint) * pow(fabs(c), source[SRC_FOCUS]);
    }
    return out;
}

inline float3 picture_at(__global const float *source, __global const float4 *pictures, float s, float t)
{
    int first = (int)source[SRC_PICTURE], width = (int)source[SRC_PICTURE + 1], height = (int)source[SRC_PICTURE + 2];
    if (first < 0) return (float3)(1.0f);
    float x = within(s * width - 0.5f, 0.0f, width - 1.0f), y = within(t * height - 0.5f, 0.0f, height - 1.0f);
    int i = (int)x, j = (int)y, i1 = lesser(i + 1, width - 1), j1 = lesser(j + 1, height - 1);
    __global const float4 *p = pictures + first;
    float4 upper = p[j * width + i] * (1.0f - (x - i)) + p[j * width + i1] * (x - i);
    float4 lower = p[j1 * width + i] * (1.0f - (x - i)) + p[j1 * width + i1] * (x - i);
    return (upper * (1.0f - (y - j)) + lower * (y - j)).xyz;
}

/* ── domes ── */

/* shares of width and height of a latlong picture, of a world direction */
inline float2 latlong_of(__global const float *source, float3 d)
{
    float3 l = local_of(source, d);
    return (float2)(0.5f - turn_of(l.x, l.z), 0.5f - 2.0f * turn_of(l.y, sqrt(l.x * l.x + l.z * l.z)));
}

inline float3 dome_radiance(__global const float *source, __global const float4 *pictures, float3 d)
{
    int first = (int)source[SRC_PICTURE], width = (int)source[SRC_PICTURE + 1], height = (int)source[SRC_PICTURE + 2];
    if (width * height == 1) return pictures[first].xyz;
    float2 at = latlong_of(source, d);
    float s = at.x * width - 0.5f, t = within(at.y * height - 0.5f, 0.0f, height - 1.0f);
    float left = floor(s);
    int i = (int)left, j = lesser((int)t, larger(height - 2, 0));
    float fs = s - left, ft = t - j;
    int i0 = (i + width) % width, i1 = (i + 1) % width, j1 = lesser(j + 1, height - 1);
    __global const float4 *p = pictures + first;
    float4 upper = p[j * width + i0] * (1.0f - fs) + p[j * width + i1] * fs;
    float4 lower = p[j1 * width + i0] * (1.0f - fs) + p[j1 * width + i1] * fs;
    return (upper * (1.0f - ft) + lower * ft).xyz;
}

/* what a ray sees of a dome that stands for directions in which nothing was drawn: its mean over MIRRORED_ANGLE, from an
 * octahedral table of WIDE_SIDE */
inline float3 dome_about(__global const float *source, __global const float4 *pictures, float3 d)
{
    if ((int)source[SRC_WIDE] < 0) return dome_radiance(source, pictures, d);
    float3 l = local_of(source, d);
    float half_side = 0.5f * WIDE_SIDE, scale = half_side / (fabs(l.x) + fabs(l.y) + fabs(l.z));
    float u = l.x * scale, v = l.y * scale;
    float a = l.z < 0.0f ? copysign(half_side - fabs(v), u) : u, b = l.z < 0.0f ? copysign(half_side - fabs(u), v) : v;
    int i = within((int)(a + half_side), 0, WIDE_SIDE - 1), j = within((int)(b + half_side), 0, WIDE_SIDE - 1);
    return pictures[(int)source[SRC_WIDE] + j * WIDE_SIDE + i].xyz;
}

inline float dome_density(__global const float *source, __global const float *tables, float3 d)
{
    int width = (int)source[SRC_PICTURE + 1], height = (int)source[SRC_PICTURE + 2];
    float2 at = latlong_of(source, d);
    int row = within((int)(at.y * height), 0, height - 1), column = within((int)(at.x * width), 0, width - 1);
    __global const float *table = tables + (int)source[SRC_TABLE];
    /* table: rows (height), columns (width), densities */
    int r = (int)table[row], c = (int)table[height + column];
    return table[height + width + r * (int)source[SRC_TABLE + 1] + c];
}

/* ── drawing ── */

/* a direction towards a flat light, without what varies of its radiance; density 0: its back is seen; at: where on it */
inline void draw_flat_at(__global const float *source, Triple p, float u, float v, float2 *at, Triple *d, float *distance, float *density)
{
    float width = source[SRC_SIZE], height = source[SRC_SIZE + 1];
    int is_rect = (int)source[SRC_KIND] == RECT;
    float2 turned = cos_sin_of_turn(is_rect ? 0.0f : v);
    float r = width * sqrt(u);
    float x = is_rect ? (u - 0.5f) * width : r * turned.x, y = is_rect ? (v - 0.5f) * height : r * turned.y;
    float area = source[SRC_VOLUME] * (is_rect ? width * height : PI_F * width * width);
    __global const float *m = source + SRC_LINEAR, *c = source + SRC_CENTER;
    Triple to = triple(c[0] + m[0] * x + m[1] * y - p.x, c[1] + m[3] * x + m[4] * y - p.y, c[2] + m[6] * x + m[7] * y - p.z);
    float d2 = inner(to, to), along = inner(to, triple(m[2], m[5], m[8])); /* seen from where it shines: below -Z */
    *distance = sqrt(d2);
    *d = times(1.0f / *distance, to);
    *density = along > 0.0f ? d2 * *distance / (along * area) : 0.0f;
    *at = (float2)(x, y);
}

inline Arrival draw_flat(__global const float *source, __global const float4 *pictures, float3 p, float2 u)
{
    Arrival a = {(float3)(0.0f, 0.0f, 1.0f), INFINITY, (float3)(0.0f), 0.0f};
    Triple d;
    float2 q;
    float distance, density;
    draw_flat_at(source, triple(p), u.x, u.y, &q, &d, &distance, &density);
    if (!(density > 0.0f)) return a;
    a.distance = distance;
    a.direction = vector(d);
    a.density = density;
    a.radiance = row3(source, SRC_RADIANCE) * shaped(source, a.direction);
    if (source[SRC_PICTURE] >= 0.0f)
        a.radiance *= picture_at(source, pictures, 0.5f - q.x / source[SRC_SIZE], 0.5f - q.y / source[SRC_SIZE + 1]);
    return a;
}

inline float3 cone_direction(float3 axis, float one_minus_cos, float2 u)
{
    float k = u.x * one_minus_cos, s = sqrt(larger(k * (2.0f - k), 0.0f));
    float2 c = cos_sin_of_turn(u.y);
    float3 t, b;
    frame_about(axis, &t, &b);
    return s * c.x * t + s * c.y * b + (1.0f - k) * axis;
}

inline float sphere_cone(float d2, float radius)
{
    float s2 = radius * radius / larger(d2, 1e-30f);
    return s2 < 1.0f ? s2 / (1.0f + sqrt(1.0f - s2)) : 0.0f;
}

/* a direction, distance and density of the light's own frame, as of the world */
inline Arrival from_local(__global const float *source, float3 w, float distance, float density)
{
    float3 d = world_of(source, w);
    float l = size_of(d);
    Arrival a = {d / l, distance * l, (float3)(0.0f), density * l * l * l / source[SRC_VOLUME]};
    a.radiance = row3(source, SRC_RADIANCE) * shaped(source, a.direction);
    return a;
}

inline Arrival draw_sphere(__global const float *source, float3 p, float2 u)
{
    Arrival none = {(float3)(0.0f, 0.0f, 1.0f), INFINITY, (float3)(0.0f), 0.0f};
    float3 l = local_of(source, p - row3(source, SRC_CENTER));
    float radius = source[SRC_SIZE], d2 = inner(l, l), m = sphere_cone(d2, radius);
    if (!(m > 0.0f)) return none;
    float d = sqrt(d2), k = u.x * m;
    float3 w = cone_direction(-l / d, m, u);
    float distance = d * (1.0f - k) - sqrt(larger(radius * radius - d2 * k * (2.0f - k), 0.0f));
    return from_local(source, w, distance, 1.0f / (TURN * m));
}

inline Arrival draw_cylinder(__global const float *source, float3 p, float2 u)
{
    Arrival none = {(float3)(0.0f, 0.0f, 1.0f), INFINITY, (float3)(0.0f), 0.0f};
    float3 l = local_of(source, p - row3(source, SRC_CENTER));
    float radius = source[SRC_SIZE], half_length = 0.5f * source[SRC_SIZE + 1];
    float rho = sqrt(l.y * l.y + l.z * l.z);
    if (!(rho > radius)) return none;
    float ey = -l.y / rho, ez = -l.z / rho, limit = asin(radius / rho), turned = (2.0f * u.x - 1.0f) * limit;
    float c = cos(turned), s = sin(turned);
    float wall = larger(rho * c - sqrt(larger(radius * radius - rho * s * rho * s, 0.0f)), 1e-30f);
    float a = -half_length - l.x, b = half_length - l.x;
    float s0 = a * rsqrt(a * a + wall * wall), s1 = b * rsqrt(b * b + wall * wall);
    float up = s0 + u.y * (s1 - s0), flat = sqrt(larger(1.0f - up * up, 0.0f));
    if (!(s1 > s0 && flat > 0.0f)) return none;
    float3 w = (float3)(up, flat * (c * ey - s * ez), flat * (c * ez + s * ey));
    return from_local(source, w, wall / flat, 1.0f / (2.0f * limit * (s1 - s0)));
}

inline Arrival draw_point(__global const float *source, float3 p)
{
    Arrival a = {(float3)(0.0f, 0.0f, 1.0f), INFINITY, (float3)(0.0f), 0.0f};
    float3 to = row3(source, SRC_CENTER) - p;
    float d2 = inner(to, to);
    if (!(d2 > 0.0f)) return a;
    a.distance = sqrt(d2);
    a.direction = to / a.distance;
    a.density = 1.0f;
    float across = size_of(local_of(source, a.direction)) * source[SRC_VOLUME];
    a.radiance = PI_F * source[SRC_SIZE] * source[SRC_SIZE] * across / d2 * row3(source, SRC_RADIANCE) * shaped(source, a.direction);
    return a;
}

inline float glow_pdf(__global const float *glow_density, __global const float *face_normal, int t, float3 d, float distance)
{
    return glow_density[t] * distance * distance / larger(fabs(inner(load3(face_normal, t), d)), 1e-6f);
}

inline Arrival draw_glowing(SCENE_PARAMETERS, float3 p, float2 u)
{
    Arrival a = {(float3)(0.0f, 0.0f, 1.0f), INFINITY, (float3)(0.0f), 0.0f};
    int low = 0, high = glowing_count - 1;
    while (low < high) {
        int middle = (low + high) / 2;
        if (cumulative[middle] > u.x) high = middle; else low = middle + 1;
    }
    float before = low > 0 ? cumulative[low - 1] : 0.0f;
    float first = within((u.x - before) / larger(cumulative[low] - before, 1e-30f), 0.0f, 1.0f);
    float root = sqrt(first), b0 = root * (1.0f - u.y), b1 = root * u.y;
    size_t t = glowing[low];
    float3 p0 = load3(corners, 3 * t);
    float3 to = p0 + b0 * (load3(corners, 3 * t + 1) - p0) + b1 * (load3(corners, 3 * t + 2) - p0) - p;
    a.distance = sqrt(inner(to, to));
    a.direction = to / larger(a.distance, 1e-20f);
    float density = glow_pdf(glow_density, face_normal, t, a.direction, a.distance);
    if (!(density > 0.0f && isfinite(density))) return a;
    a.density = density;
    a.radiance = emission_at(materials + material_of[t] * MAT, refs, images, texels, uvs, triangles, t, b0, b1);
    return a;
}

/* place: of the drawn directions of a dome */
inline Arrival draw_source(SCENE_PARAMETERS, int s, float3 p, float2 u, uint place)
{
    Arrival a = {(float3)(0.0f, 0.0f, 1.0f), INFINITY, (float3)(0.0f), 0.0f};
    __global const float *source = sources + s * SOURCE;
    int kind = (int)source[SRC_KIND];
    if (kind == RECT || kind == DISK) return draw_flat(source, pictures, p, u);
    if (kind == SPHERE) return draw_sphere(source, p, u);
    if (kind == CYLINDER) return draw_cylinder(source, p, u);
    if (kind == POINT) return draw_point(source, p);
    if (kind == GLOWING) return draw_glowing(SCENE, p, u);
    if (kind == DISTANT) {
        float m = source[SRC_SIZE];
        float3 towards = -row3(source, SRC_AXIS);
        a.direction = m > 0.0f ? cone_direction(towards, m, u) : towards;
        a.density = m > 0.0f ? 1.0f / (TURN * m) : 1.0f;
        a.radiance = row3(source, SRC_RADIANCE) * shaped(source, a.direction);
        return a;
    }
    __global const float *one = drawn + ((size_t)source[SRC_DRAWN] * DRAWN + place) * 8;
    a.direction = row3(one, 0);
    a.density = one[3];
    a.radiance = row3(one, 4);
    return a;
}

/* ── meeting ── */

/* of a light with a place: distance and radiance where a ray meets it before `limit`, and the density of drawing it */
inline Arrival meet_source(__global const float *source, __global const float4 *pictures, float3 p, float3 d, float limit)
{
    Arrival none = {d, INFINITY, (float3)(0.0f), 0.0f};
    int kind = (int)source[SRC_KIND];
    if (kind == DISTANT) {
        float m = source[SRC_SIZE];
        float3 off = d + row3(source, SRC_AXIS);
        if (inner(off, off) > 2.0f * m || limit < INFINITY) return none;
        Arrival a = {d, INFINITY, row3(source, SRC_RADIANCE) * shaped(source, d), 1.0f / (TURN * m)};
        return a;
    }
    float3 to = row3(source, SRC_CENTER) - p;
    float along = inner(to, d), reach = source[SRC_REACH];
    if (along < -reach || inner(to, to) - along * along > reach * reach) return none;
    float3 l = local_of(source, -to);
    if (kind == RECT || kind == DISK) {
        float3 n = (float3)(source[SRC_LINEAR + 2], source[SRC_LINEAR + 5], source[SRC_LINEAR + 8]);
        float facing = inner(d, n), height = inner(to, n);
        if (!(height > 0.0f && facing > 0.0f)) return none;
        float t = height / facing;
        float3 q = l + t * local_of(source, d);
        float width = source[SRC_SIZE], depth = source[SRC_SIZE + 1], area = source[SRC_VOLUME];
        int inside = kind == RECT ? (fabs(q.x) <= 0.5f * width) & (fabs(q.y) <= 0.5f * depth) : q.x * q.x + q.y * q.y <= width * width;
        if (!inside || !(t <= limit)) return none;
        area *= kind == RECT ? width * depth : PI_F * width * width;
        Arrival a = {d, t, row3(source, SRC_RADIANCE) * shaped(source, d), t * t / (facing * area)};
        if (source[SRC_PICTURE] >= 0.0f) a.radiance *= picture_at(source, pictures, 0.5f - q.x / width, 0.5f - q.y / depth);
        return a;
    }
    float3 w = local_of(source, d);
    float stretch = 1.0f / size_of(w), distance, density;
    w *= stretch;
    float radius = source[SRC_SIZE];
    if (kind == SPHERE) {
        float m = sphere_cone(inner(l, l), radius), forward = -inner(l, w);
        float3 off = l + forward * w;
        float inside = radius * radius - inner(off, off);
        if (!(m > 0.0f && forward > 0.0f && inside >= 0.0f)) return none;
        distance = forward - sqrt(inside);
        density = 1.0f / (TURN * m);
    } else {
        float rho = sqrt(l.y * l.y + l.z * l.z), flat = sqrt(w.y * w.y + w.z * w.z), half_length = 0.5f * source[SRC_SIZE + 1];
        if (!(rho > radius && flat > 0.0f)) return none;
        float c = -(l.y * w.y + l.z * w.z) / (rho * flat), s = (l.y * w.z - l.z * w.y) / (rho * flat);
        if (!(c > 0.0f && fabs(s) * rho <= radius)) return none;
        float wall = rho * c - sqrt(larger(radius * radius - rho * s * rho * s, 0.0f));
        distance = wall / flat;
        float a = -half_length - l.x, b = half_length - l.x;
        float s0 = a * rsqrt(a * a + wall * wall), s1 = b * rsqrt(b * b + wall * wall);
        if (!(fabs(l.x + distance * w.x) <= half_length && s1 > s0)) return none;
        density = 1.0f / (2.0f * asin(lesser(radius / rho, 1.0f)) * (s1 - s0));
    }
    distance *= stretch;
    if (!(distance <= limit)) return none;
    Arrival a = {d, distance, row3(source, SRC_RADIANCE) * shaped(source, d), density * stretch * stretch * stretch / source[SRC_VOLUME]};
    return a;
}

/* ── choosing ── */

/* a rough guess of the irradiance that a source brings */
inline float importance(__global const float *source, float3 p)
{
    if (source[SRC_SAMPLED] <= 0.0f) return 0.0f;
    float power = source[SRC_POWER], spread = source[SRC_POWER + 1];
    if (spread < 0.0f) return power;
    float3 to = p - row3(source, SRC_CENTER);
    return power / (inner(to, to) + spread);
}

/* with which probability source s is looked at from p; in proportion to the guess, a fifth spread evenly */
inline float chance_of(__global const float *sources, const int source_count, int s, float3 p)
{
    float total = 0.0f, mine = 0.0f, worth = 0.0f;
    for (int k = 0; k < source_count; k++) {
        float i = importance(sources + k * SOURCE, p);
        total += i;
        worth += sources[k * SOURCE + SRC_SAMPLED] > 0.0f ? 1.0f : 0.0f;
        mine = k == s ? i : mine;
    }
    if (sources[s * SOURCE + SRC_SAMPLED] <= 0.0f) return 0.0f;
    float even = 1.0f / worth;
    return 0.8f * (total > 0.0f ? mine / total : even) + 0.2f * even;
}

/* the source that a number of [0, 1) chooses, and its chance; -1: there is none */
inline int choose_source(__global const float *sources, const int source_count, float3 p, float x, float *chance)
{
    float total = 0.0f, worth = 0.0f;
    for (int k = 0; k < source_count; k++) {
        total += importance(sources + k * SOURCE, p);
        worth += sources[k * SOURCE + SRC_SAMPLED] > 0.0f ? 1.0f : 0.0f;
    }
    *chance = 0.0f;
    int last = -1;
    float sum = 0.0f;
    for (int k = 0; k < source_count; k++) {
        if (sources[k * SOURCE + SRC_SAMPLED] <= 0.0f) continue;
        float even = 1.0f / worth;
        float one = 0.8f * (total > 0.0f ? importance(sources + k * SOURCE, p) / total : even) + 0.2f * even;
        last = k;
        *chance = one;
        sum += one;
        if (x < sum) break;
    }
    return last;
}
