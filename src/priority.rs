//! Real-time priority for the pipeline's thread, where the system permits it.

use thread_priority::{
    NormalThreadSchedulePolicy, RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Enough to go before everything ordinary, and behind what the kernel itself does in real time.
const PRIORITY: u8 = 10;

/// Lets the calling thread go before all ordinary ones (SCHED_FIFO). Threads that it starts from now on do so, too, until they call
/// [`background`].
///
/// # Errors
/// Where the system does not permit it, with what to do about it.
pub fn real_time() -> Result<(), String> {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let priority = PRIORITY.try_into().map(ThreadPriority::Crossplatform)?;
    set_thread_priority_and_policy(thread_native_id(), priority, policy).map_err(|error| {
        format!(
            "real-time priority is not permitted ({error:?}): raise the limit with `ulimit -r {PRIORITY}`, LimitRTPRIO={PRIORITY} in a systemd \
             unit, or `setcap cap_sys_nice=ep` on the program; mapping goes on without"
        )
    })
}

/// Lets the calling thread go behind all others, also where it was started by one in real time: what it does can wait.
pub fn background() {
    let policy = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Other);
    // Nobody needs a permit for less.
    let _ = set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Min, policy);
}
