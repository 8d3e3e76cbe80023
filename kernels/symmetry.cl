/* symmetry.cl: the basis in which the reflection operator falls into small blocks.  Device twin of usdslf/light_field/symmetry.py.
 *
 * H x H cells of a quarter of the coarse map, each of which stands for four bins.
 */
#define H (SIDE / 4)
#define CELLS (H * H)
#define ALIKE (H * (H + 1) / 2)
#define OPPOSITE (H * (H - 1) / 2)
#define ODD (ALIKE + OPPOSITE) /* first of those that are odd under both flips */
#define EVEN_ODD (2 * ODD)
#define ODD_EVEN (2 * ODD + CELLS)

inline int alike_of(int y, int x) { return y * H - y * (y - 1) / 2 + x - y; }                /* y <= x */
inline int opposite_of(int y, int x) { return y * (H - 1) - y * (y - 1) / 2 + x - y - 1; } /* y < x */
inline int folded_bin(int y, int x, int low, int left) { return (low ? 2 * H - 1 - y : y) * 2 * H + (left ? 2 * H - 1 - x : x); }
inline int fine_bin(int q, int k) { return ((q / (SIDE / 2)) * 2 + k / 2) * SIDE + (q % (SIDE / 2)) * 2 + k % 2; }
