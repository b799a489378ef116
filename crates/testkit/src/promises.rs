//! What is promised to whoever trusts a robot to slamd, and what keeps each promise.

/// A promise.
pub struct Promise {
    pub says: &'static str,
    /// The test that keeps it in CI: its file and its name.
    pub test: (&'static str, &'static str),
    /// The long run of `cargo xtask` that tests the same for longer, if any: a name of [`LONG`].
    pub long_run: Option<&'static str>,
}

/// The long runs: task of `cargo xtask`, and options with their full numbers.
pub const LONG: [(&str, &[(&str, f64)]); 4] = [
    ("simulation", &[("--seeds", 2000.0)]),
    ("fuzz", &[("--bytes", 1e9), ("--files", 1e6)]),
    ("kill", &[("--kills", 1000.0)]),
    ("soak", &[("--minutes", 60.0), ("--hours", 72.0)]),
];

const fn promise(
    says: &'static str,
    file: &'static str,
    name: &'static str,
    long_run: Option<&'static str>,
) -> Promise {
    Promise { says, test: (file, name), long_run }
}

/// All of them.
pub const PROMISES: [Promise; 31] = [
    promise(
        "Whatever goes wrong with line, board, clock and disk at once: no bad frame is accepted, time never runs back, a recording is what was read, and the \
         map is that of its replay.",
        "tests/wire/simulation.rs",
        "nothing_that_goes_wrong_breaks_a_promise",
        Some("simulation"),
    ),
    promise(
        "Whatever comes over the wire, nothing panics and memory stays bounded.",
        "tests/wire/fuzz.rs",
        "no_bytes_panic",
        Some("fuzz"),
    ),
    promise(
        "Whatever a capture, session file, configuration or map holds, nothing panics, each is read or refused within a second.",
        "tests/wire/fuzz.rs",
        "no_file_panics",
        Some("fuzz"),
    ),
    promise(
        "A recording can be read after a kill at any moment; at most 100 ms are lost.",
        "tests/files/kill.rs",
        "what_was_recorded_before_a_kill_can_be_read",
        Some("kill"),
    ),
    promise(
        "A full disk holds up nothing; what waited is written when there is room again.",
        "tests/files/full_disk.rs",
        "a_full_disk_holds_up_nothing_and_costs_nothing",
        None,
    ),
    promise(
        "A disk full for long costs the end of that time, and bounded memory.",
        "tests/files/recording.rs",
        "a_disk_full_for_too_long_costs_the_end_of_that_time_and_bounded_memory",
        None,
    ),
    promise(
        "Short writes and failing ones cost nothing.",
        "tests/files/recording.rs",
        "short_writes_and_moods_that_change_each_second_cost_nothing",
        None,
    ),
    promise(
        "A recording keeps to its size and time, and leaves the disk the room that others need.",
        "tests/files/recording.rs",
        "the_room_that_others_need_is_left_to_them",
        None,
    ),
    promise(
        "Recordings are their owner's alone.",
        "tests/files/recording.rs",
        "recordings_are_their_owners_alone_and_leave_others_in_peace",
        None,
    ),
    promise("A recording replays bit for bit.", "tests/wire/live.rs", "a_recording_replays_bit_for_bit", Some("soak")),
    promise(
        "A hundred pulls of the plug are survived.",
        "tests/wire/replug.rs",
        "a_hundred_replugs_are_survived",
        None,
    ),
    promise(
        "Map and pose go on when the port returns, under whatever name.",
        "tests/wire/link.rs",
        "map_and_pose_go_on_when_the_port_returns_under_another_name",
        None,
    ),
    promise(
        "A board that restarts costs no pose.",
        "crates/core/tests/estimator/handshake.rs",
        "a_board_that_restarts_in_mid_stream_costs_no_pose",
        None,
    ),
    promise(
        "Viewers that hang or never come are not in the way.",
        "tests/doors/viewer.rs",
        "viewers_that_hang_or_never_come_are_not_in_the_way",
        None,
    ),
    promise(
        "Each kind of broken sensor is found in time, named, and forgiven when it passes.",
        "crates/core/tests/estimator/faults.rs",
        "each_kind_is_found_in_time_and_named_and_forgiven_when_it_passes",
        None,
    ),
    promise(
        "Healthy sensors stay trusted.",
        "crates/core/tests/estimator/faults.rs",
        "healthy_sensors_stay_trusted",
        None,
    ),
    promise(
        "A slip of the wheels is noticed, told and mended.",
        "crates/core/tests/estimator/lock.rs",
        "a_slip_is_noticed_told_and_mended",
        None,
    ),
    promise(
        "Eight of 32 sensors that break, in all kinds, cost less than half as much again.",
        "crates/core/tests/estimator/sensor_faults.rs",
        "a_side_of_missing_sensors_and_eight_of_all_kinds_cost_little",
        None,
    ),
    promise(
        "A dead wheel encoder is named, and no certain pose is wrong.",
        "crates/core/tests/estimator/sensor_faults.rs",
        "a_dead_encoder_is_named_and_no_certain_pose_is_wrong",
        None,
    ),
    promise(
        "A reversed wheel encoder is named and turned over.",
        "crates/core/tests/estimator/sensor_faults.rs",
        "a_reversed_encoder_is_named_and_turned_over_on_the_way",
        None,
    ),
    promise(
        "A client that does not read is dropped with a notice, and nothing is lost.",
        "tests/doors/api.rs",
        "who_reads_nothing_is_dropped_and_the_pipeline_loses_nothing",
        None,
    ),
    promise(
        "64 clients, lines of 64 KiB, 20 s of silence: no more, and it is told.",
        "tests/doors/api.rs",
        "limits_are_kept_and_told",
        None,
    ),
    promise("The network is let in by no mistake.", "tests/doors/api.rs", "the_network_is_let_in_by_no_mistake", None),
    promise(
        "Whoever comes over the network must know the token.",
        "tests/doors/api.rs",
        "whoever_comes_over_tcp_must_know_the_token",
        None,
    ),
    promise(
        "A board plays no tricks on a terminal.",
        "tests/doors/api.rs",
        "a_board_plays_no_tricks_on_a_terminal",
        None,
    ),
    promise("The service is walled in.", "tests/program/systemd.rs", "little_is_left_open", None),
    promise(
        "Input meets no unwrap, no unchecked index and no unchecked cast.",
        "tests/tree/input_path.rs",
        "the_input_path_carries_the_lints",
        None,
    ),
    promise(
        "No crate of ours is unsafe, and overflow is checked in releases.",
        "tests/tree/input_path.rs",
        "no_crate_is_unsafe_and_overflow_is_checked",
        None,
    ),
    promise(
        "All that is built has an allowed license and comes from the registry.",
        "tests/tree/dependencies.rs",
        "all_that_is_built_may_be",
        None,
    ),
    promise(
        "A damaged session file is refused with the cause.",
        "tests/files/session_file.rs",
        "each_damage_is_named",
        None,
    ),
    promise(
        "No sweep allocates; nothing grows with time.",
        "crates/core/tests/estimator/allocation.rs",
        "no_sweep_allocates_with_the_walls_method",
        Some("soak"),
    ),
];
