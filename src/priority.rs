//! Real-time priority for the pipeline's thread, where the system permits it.

use thread_priority::{
    NormalThreadSchedulePolicy, RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Above all normal threads and below the kernel's own real-time threads.
const PRIORITY: u8 = 10;

/// Gives the calling thread priority over all normal threads (SCHED_FIFO). Threads that it starts later inherit the priority until they call
/// [`background`].
///
/// # Errors
/// When the system does not permit it, with what to do.
pub fn real_time() -> Result<(), String> {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let priority = PRIORITY.try_into().map(ThreadPriority::Crossplatform)?;
    set_thread_priority_and_policy(thread_native_id(), priority, policy).map_err(|error| {
        format!(
            "real-time priority is not permitted ({error:?}): raise the limit with `ulimit -r {PRIORITY}`, LimitRTPRIO={PRIORITY} in a systemd \
             unit, or `setcap cap_sys_nice=ep` on the program; mapping continues without it"
        )
    })
}

/// Gives the calling thread the lowest normal priority, even if a real-time thread started it: its work can wait.
pub fn background() {
    let policy = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Other);
    // Lowering the priority needs no permission.
    let _ = set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Min, policy);
}
