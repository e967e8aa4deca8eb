// Height maps on even grids, each turned and placed on the mirror as it likes: cubic B-splines, along z. The twin of
// irtscots_cl/maths/bicubic.py. Frame: the mirror's. Unit: mm.
//
// A grid's coefficients lie in `tables` from its offset on, row by row, stride to a row, with a border of one around
// the nodes. Beyond its edge a map goes on at the edge's height.
#include "simd_*.cl"
#include "gather_*.cl"

// Weights of four neighbouring coefficients in the height and in its derivative, t from 0 to 1 in the cell.
INLINE void map_weights(realv t, realv *height, realv *slope) {
    const realv s = 1 - t, ss = s * s, tt = t * t;
    const real middle = (real)0.5, sixth = (real)(1.0 / 6), most = (real)(2.0 / 3);
    height[0] = sixth * s * ss;
    height[1] = most - middle * tt * (1 + s);
    height[2] = most - middle * ss * (1 + t);
    height[3] = sixth * t * tt;
    slope[0] = -middle * ss;
    slope[1] = middle * t * (3 * t - 4);
    slope[2] = middle * s * (4 - 3 * s);
    slope[3] = middle * tt;
}

// The place on the grid; of NaN: 0.
INLINE realv map_inside(realv place, real last) {
    const realv above = place > 0 ? place : (realv)0;
    return above < last ? above : (realv)last;
}

INLINE intv map_cell(realv inside, int count) {
    const intv cell = to_int(inside), last = count - 2;
    return cell < last ? cell : last;
}

// Adds one map's height [mm] at (x, y) [mm] to *sum, and its slopes to *slope_x and *slope_y.
INLINE void map_grid_add(__constant MapGrid *grid, __global const real *tables, realv x, realv y, realv *sum,
                         realv *slope_x, realv *slope_y) {
    const realv column = grid->column_x * x + grid->column_y * y + grid->column;
    const realv row = grid->row_x * x + grid->row_y * y + grid->row;
    const realv u = map_inside(column, grid->columns - 1), v = map_inside(row, grid->rows - 1);
    const intv left = map_cell(u, grid->columns), low = map_cell(v, grid->rows);
    realv by_u[4], by_u_slope[4], by_v[4], by_v_slope[4], nodes[4][4];
    map_weights(u - to_real(left), by_u, by_u_slope);
    map_weights(v - to_real(low), by_v, by_v_slope);
    gather4x4(tables, low * grid->stride + left + grid->offset, grid->stride, nodes);
    realv height = 0, along_u = 0, along_v = 0;
    for (int j = 0; j < 4; ++j) {
        const realv *node = nodes[j];
        const realv level = by_u[0] * node[0] + by_u[1] * node[1] + by_u[2] * node[2] + by_u[3] * node[3];
        height += by_v[j] * level;
        along_v += by_v_slope[j] * level;
        along_u += by_v[j] * (by_u_slope[0] * node[0] + by_u_slope[1] * node[1] + by_u_slope[2] * node[2]
                              + by_u_slope[3] * node[3]);
    }
    along_u = u == column ? along_u : (realv)0;
    along_v = v == row ? along_v : (realv)0;
    *sum += height;
    *slope_x += grid->column_x * along_u + grid->row_x * along_v;
    *slope_y += grid->column_y * along_u + grid->row_y * along_v;
}

// Adds the height [mm] of all maps at (x, y) [mm] to *sum, and their slopes to *slope_x and *slope_y.
INLINE void map_add(__constant Scene *scene, __global const real *tables, realv x_mm, realv y_mm, realv *sum,
                    realv *slope_x, realv *slope_y) {
    for (int k = 0; k < (int)(sizeof(scene->map.grid) / sizeof(MapGrid)); ++k)
        map_grid_add(&scene->map.grid[k], tables, x_mm, y_mm, sum, slope_x, slope_y);
}
