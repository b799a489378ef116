//! slamd's promises to its users, and the test that checks each promise.

/// A promise.
pub struct Promise {
    pub says: &'static str,
    /// The test that keeps it in CI: its file and its name.
    pub test: (&'static str, &'static str),
    /// The long run that tests the same for longer, if any: a name of [`LONG`].
    pub long_run: Option<&'static str>,
}

/// A long run.
pub struct LongRun {
    pub name: &'static str,
    /// The task of `cargo xtask`.
    pub task: &'static str,
    /// Options with their full numbers.
    pub options: &'static [(&'static str, f64)],
}

const fn long(name: &'static str, task: &'static str, options: &'static [(&'static str, f64)]) -> LongRun {
    LongRun { name, task, options }
}

/// The long runs.
pub const LONG: [LongRun; 6] = [
    long("simulation", "simulation", &[("--seeds", 2000.0)]),
    long("fuzz", "fuzz", &[("--bytes", 1e9), ("--files", 1e6)]),
    long("coverage", "coverage", &[("--minutes", 120.0)]),
    long("kill", "kill", &[("--kills", 1000.0)]),
    long("soak", "soak", &[("--minutes", 60.0), ("--hours", 0.0)]),
    long("laps", "soak", &[("--minutes", 0.0), ("--hours", 72.0)]),
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
        "With simultaneous faults of link, board, clock and disk: no bad frame is accepted, time is monotonic, a recording holds what was read, and its \
         replay makes the same map.",
        "tests/wire/simulation.rs",
        "no_fault_breaks_a_promise",
        Some("simulation"),
    ),
    promise(
        "No bytes on the link cause a panic or unbounded memory.",
        "tests/wire/fuzz.rs",
        "no_bytes_panic",
        Some("fuzz"),
    ),
    promise(
        "No capture, session file, configuration or map causes a panic; each is read or refused within a second.",
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
        "A full disk does not delay mapping; waiting data is written when there is space again.",
        "tests/files/full_disk.rs",
        "a_full_disk_blocks_nothing_and_loses_nothing",
        None,
    ),
    promise(
        "A disk that is full for long costs the end of that time and bounded memory.",
        "tests/files/recording.rs",
        "a_disk_full_for_long_loses_the_end_of_that_time_and_memory_stays_bounded",
        None,
    ),
    promise(
        "Short and failing writes lose nothing.",
        "tests/files/recording.rs",
        "short_writes_and_errors_that_change_each_second_lose_nothing",
        None,
    ),
    promise(
        "A recording respects its limits of size, time and free disk space.",
        "tests/files/recording.rs",
        "free_space_is_left_to_others",
        None,
    ),
    promise(
        "Only their owner can read recordings.",
        "tests/files/recording.rs",
        "recordings_are_private_and_spare_other_files",
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
        "Map and pose continue when the port returns, under any name.",
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
        "Viewers that hang or never connect do not delay mapping.",
        "tests/doors/viewer.rs",
        "stalled_and_absent_viewers_never_block_mapping",
        None,
    ),
    promise(
        "Each kind of sensor fault is detected in time, named, and cleared when it passes.",
        "crates/core/tests/estimator/faults.rs",
        "each_fault_is_found_in_time_named_and_cleared_after_recovery",
        None,
    ),
    promise(
        "Healthy sensors stay trusted.",
        "crates/core/tests/estimator/faults.rs",
        "healthy_sensors_stay_trusted",
        None,
    ),
    promise(
        "A wheel slip is detected, reported and corrected.",
        "crates/core/tests/estimator/lock.rs",
        "a_slip_is_detected_reported_and_corrected",
        None,
    ),
    promise(
        "Faults of all kinds in eight of 32 sensors increase the error by less than half.",
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
        "A reversed wheel encoder is named and its sign corrected.",
        "crates/core/tests/estimator/sensor_faults.rs",
        "a_reversed_encoder_is_named_and_its_sign_corrected",
        None,
    ),
    promise(
        "A client that does not read is dropped with a notice, and nothing is lost.",
        "tests/doors/api.rs",
        "a_client_that_does_not_read_is_dropped_and_the_pipeline_loses_nothing",
        None,
    ),
    promise(
        "Limits of 64 clients, lines of 64 KiB and 20 s of silence are enforced and reported.",
        "tests/doors/api.rs",
        "limits_are_enforced_and_reported",
        None,
    ),
    promise(
        "The API is not open to the network by mistake.",
        "tests/doors/api.rs",
        "network_access_needs_a_private_token_file",
        None,
    ),
    promise(
        "Clients from the network must send the token.",
        "tests/doors/api.rs",
        "tcp_clients_must_send_the_token",
        None,
    ),
    promise(
        "Text from a board cannot control a terminal.",
        "tests/doors/api.rs",
        "control_characters_of_a_board_never_reach_a_terminal",
        None,
    ),
    promise("The service is sandboxed.", "tests/program/systemd.rs", "the_service_is_sandboxed", None),
    promise(
        "Code that handles input has no unwrap, no unchecked index and no unchecked cast.",
        "tests/tree/input_path.rs",
        "the_input_path_carries_the_lints",
        None,
    ),
    promise(
        "slamd's crates have no unsafe code, and releases check overflow.",
        "tests/tree/input_path.rs",
        "no_crate_is_unsafe_and_overflow_is_checked",
        None,
    ),
    promise(
        "All dependencies have an allowed license and come from the registry.",
        "tests/tree/dependencies.rs",
        "dependencies_have_allowed_licenses_and_come_from_the_registry",
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
        Some("laps"),
    ),
];
