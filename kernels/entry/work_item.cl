// What one work-item of a trace_* kernel traces: consecutive rays of one source.
#include "simd_*.cl"

// source: a screen pixel, or a visible pixel in the adjoint estimators. Its rays: begin ... end - 1.
typedef struct { uint source; ulong begin, end; } WorkItem;

// Grid: (sources of the launch, runs of rays_per_item rays of each); the last run may be shorter.
INLINE WorkItem work_item(const Launch *launch) {
    const ulong begin = launch->first_ray + get_global_id(1) * launch->rays_per_item;
    const ulong end = min(begin + launch->rays_per_item, launch->first_ray + launch->ray_count);
    return (WorkItem){(uint)(launch->first_source + get_global_id(0)), begin, end};
}
