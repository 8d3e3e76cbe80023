/* visible_normals.cl: drawing light directions of GGX's lobe, by the normals that it shows to the eye, and their density.
 *
 * Normals are drawn as spherical caps (Dupuy and Benyoub 2023); the density is Heitz 2018, Eq. 17.
 */
#include "common.cl"

/* a normal that GGX shows to local eye e, drawn in proportion to how much it shows */
inline float3 visible_normal(float alpha, float3 e, float2 u)
{
    float3 s = normalize((float3)(alpha * e.x, alpha * e.y, e.z));
    float phi = 2.0f * PI_F * u.x;
    float z = (1.0f - u.y) * (1.0f + s.z) - s.z;
    float r = sqrt(clamp(1.0f - z * z, 0.0f, 1.0f));
    float3 h = (float3)(r * cos(phi), r * sin(phi), z) + s;
    return normalize((float3)(alpha * h.x, alpha * h.y, max(h.z, 1e-6f)));
}

/* D of a half vector, from its sine: exact for sharp lobes too */
inline float ggx_of_half(float alpha, float3 h)
{
    float a2 = alpha * alpha;
    float t = h.z * h.z * a2 + h.x * h.x + h.y * h.y;
    return a2 / (PI_F * t * t);
}

/* density of l as the mirror of e about a visible normal h: D / (2 (e.z + Lambda)) */
inline float visible_pdf(float alpha, float d, float ez)
{
    float a2 = alpha * alpha;
    return d / (2.0f * (ez + sqrt(a2 + (1.0f - a2) * ez * ez)));
}
