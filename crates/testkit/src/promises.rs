//! What slamd promises its users, and the test that keeps each promise.

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
        "With faults of line, board, clock and disk at once, no bad frame is accepted, time never runs back, a recording holds what was read, and the \
         map equals that of its replay.",
        "tests/wire/simulation.rs",
        "no_fault_breaks_a_promise",
        Some("simulation"),
    ),
    promise(
        "No bytes on the wire cause a panic, and memory stays bounded.",
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
        "A full disk blocks nothing; waiting data is written when there is room again.",
        "tests/files/full_disk.rs",
        "a_full_disk_blocks_nothing_and_loses_nothing",
        None,
    ),
    promise(
        "If a disk is full for long, the recording loses the end of that time, and memory stays bounded.",
        "tests/files/recording.rs",
        "a_disk_full_for_long_loses_the_end_of_that_time_and_memory_stays_bounded",
        None,
    ),
    promise(
        "Short and failing writes lose nothing.",
        "tests/files/recording.rs",
        "short_and_failing_writes_lose_nothing",
        None,
    ),
    promise(
        "A recording stops growing when the disk's reserve of free space is reached, and continues when there is room.",
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
        "slamd survives a hundred replugs of the board.",
        "tests/wire/replug.rs",
        "a_hundred_replugs_are_survived",
        None,
    ),
    promise(
        "Map and pose continue when the port returns, even under another name.",
        "tests/wire/link.rs",
        "map_and_pose_go_on_when_the_port_returns_under_another_name",
        None,
    ),
    promise(
        "A restart of the board loses no pose.",
        "crates/core/tests/estimator/handshake.rs",
        "a_board_that_restarts_in_mid_stream_costs_no_pose",
        None,
    ),
    promise(
        "Stalled and absent viewers never block mapping.",
        "tests/doors/viewer.rs",
        "stalled_and_absent_viewers_never_block_mapping",
        None,
    ),
    promise(
        "Each kind of sensor fault is found in time, named, and cleared after recovery.",
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
        "Eight of 32 sensors with faults of all kinds increase the error by less than half.",
        "crates/core/tests/estimator/sensor_faults.rs",
        "a_side_of_missing_sensors_and_eight_of_all_kinds_cost_little",
        None,
    ),
    promise(
        "A dead wheel encoder is named, and no pose stated as certain is wrong.",
        "crates/core/tests/estimator/sensor_faults.rs",
        "a_dead_encoder_is_named_and_no_certain_pose_is_wrong",
        None,
    ),
    promise(
        "A reversed wheel encoder is named and its sign is corrected.",
        "crates/core/tests/estimator/sensor_faults.rs",
        "a_reversed_encoder_is_named_and_its_sign_corrected",
        None,
    ),
    promise(
        "A client that does not read is dropped with a notice, and the pipeline loses nothing.",
        "tests/doors/api.rs",
        "a_client_that_does_not_read_is_dropped_and_the_pipeline_loses_nothing",
        None,
    ),
    promise(
        "Limits for clients (64), lines (64 KiB) and silence (20 s) are enforced and reported.",
        "tests/doors/api.rs",
        "limits_are_enforced_and_reported",
        None,
    ),
    promise(
        "Access from the network needs a token file that only its owner can read.",
        "tests/doors/api.rs",
        "network_access_needs_a_private_token_file",
        None,
    ),
    promise(
        "Clients over TCP must send the token.",
        "tests/doors/api.rs",
        "clients_over_tcp_must_send_the_token",
        None,
    ),
    promise(
        "Control characters from a board never reach a terminal.",
        "tests/doors/api.rs",
        "control_characters_of_a_board_never_reach_a_terminal",
        None,
    ),
    promise("The service is sandboxed.", "tests/program/systemd.rs", "the_service_is_sandboxed", None),
    promise(
        "Code that reads input has no unwrap, no unchecked index and no unchecked cast.",
        "tests/tree/input_path.rs",
        "the_input_path_carries_the_lints",
        None,
    ),
    promise(
        "No crate contains unsafe code, and releases check for overflow.",
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
        "A damaged session file is refused, and the error names the cause.",
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
