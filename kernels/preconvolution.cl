/* preconvolution.cl: the exact reflection matrices K of one level, bin to bin.
 *
 *     K[w, d] = integral over bin d of the column's integrand, seen from the centre of bin w
 *
 * by midpoints: COARSE^2 a bin, FINE^2 where the bin lies near the mirror direction of w, since a sharp lobe is
 * narrower than a bin.  Build constants: SIDE, COARSE, FINE, MODEL.  Nguyen et al. 2013, 5.2.
 */
#include "reflectance.cl"

/* one work-item a pair (row, d)
 * rows        (row_count) outgoing bins w
 * parameter   alpha, or the Phong exponent
 * near_cosine bins whose centre lies within this cosine of the mirror direction take FINE^2 midpoints
 * a, b, y     (row_count, D): the columns A, B and Y
 */
__kernel void exact_matrix(__global const int *rows, const int row_count, const float parameter, const float near_cosine, __global float *a, __global float *b,
                           __global float *y)
{
    int d = get_global_id(0), row = get_global_id(1);
    if (d >= D_BINS || row >= row_count) return;
    int w = rows[row];
    float3 e = bin_direction(w);
    float3 mirror = (float3)(-e.x, -e.y, e.z);
    int n = dot(mirror, bin_direction(d)) > near_cosine ? FINE : COARSE;
    float step = 2.0f / (SIDE * n);
    float x0 = (d % SIDE) * (2.0f / SIDE) - 1.0f, y0 = (d / SIDE) * (2.0f / SIDE) - 1.0f;
    float4 sum = (float4)(0.0f);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            float3 l = hemisphere_from_square(x0 + (j + 0.5f) * step, y0 + (i + 0.5f) * step);
            sum += model_columns(parameter, e, l);
        }
    sum *= (2.0f * PI_F / D_BINS) / (n * n);
    size_t at = (size_t)row * D_BINS + d;
    a[at] = sum.z;
    b[at] = sum.w;
    y[at] = sum.y;
}
