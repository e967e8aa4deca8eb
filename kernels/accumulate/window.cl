// Where light is stored: the windows of the transport map, bins [visible pixel, window row, window column], and the
// ledger. A visible pixel is a detector pixel that can see the mirror; its window covers the screen pixels that can
// light it.
#include "sum64.cl"

// Forward: the light of one screen pixel, which goes into the windows of the detector pixels that it hits.
typedef struct {
    const Launch *launch;
    __global const int *visible_pixels;   // [detector pixels] number of the visible pixel, or -1: cannot see the mirror
    __global const int2 *origins;         // [visible pixels] first screen column and row of the window
    __global uint *transport;             // 64-bit sums
    __global uint *ledger;                // 64-bit sums
    __local uint *tile;                   // [detector pixels], if the accumulation uses a tile
    int column, row;                      // the screen pixel
} Hits;

// Adds count hits of a detector pixel to its window. Hits outside the window are counted as FATE_OFF_WINDOW: if there
// are any, the host enlarges the windows or raises an error.
INLINE void hits_store(const Hits *hits, int pixel, uint count) {
    const int visible_pixel = hits->visible_pixels[pixel],
              columns = hits->launch->window_columns, rows = hits->launch->window_rows;
    const int2 origin = visible_pixel < 0 ? (int2)(0) : hits->origins[visible_pixel];
    const int x = hits->column - origin.x, y = hits->row - origin.y;
    if (visible_pixel >= 0 && x >= 0 && x < columns && y >= 0 && y < rows)
        sum64_add(hits->transport, ((size_t)visible_pixel * rows + y) * columns + x, count);
    else
        sum64_add(hits->ledger, FATE_OFF_WINDOW, count);
}

// Adjoint: the light of one detector pixel. Its bins are those of the window, then one for each fate.
typedef struct {
    __global uint *window;                // 64-bit sums: this visible pixel's window in the transport
    __global uint *ledger;                // 64-bit sums
    __local ulong *tile;                  // [bins], if the accumulation uses a tile
    int window_bins, bins;
} Light;

INLINE void light_store(const Light *light, int bin, ulong amount) {
    if (bin < light->window_bins) sum64_add(light->window, bin, amount);
    else sum64_add(light->ledger, bin - light->window_bins, amount);
}
