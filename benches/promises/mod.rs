//! What is promised to whoever trusts a robot to slamd, and what keeps each promise.

#![allow(unreachable_pub, reason = "a module of a bench and of a test")]

/// A promise.
pub struct Promise {
    pub says: &'static str,
    /// The test that keeps it in CI: its file under `tests/` and its name.
    pub test: (&'static str, &'static str),
    /// The bench that tries the same for longer, if there is one: a name of [`LONG`].
    pub bench: Option<&'static str>,
}

/// The benches that try for longer: name, and options with their full numbers.
pub const LONG: [(&str, &[(&str, f64)]); 3] = [
    ("fuzz", &[("--bytes", 1e9), ("--files", 1e6)]),
    ("kill", &[("--kills", 1000.0)]),
    ("soak", &[("--minutes", 60.0), ("--hours", 72.0)]),
];

const fn promise(says: &'static str, file: &'static str, name: &'static str, bench: Option<&'static str>) -> Promise {
    Promise { says, test: (file, name), bench }
}

/// All of them.
pub const PROMISES: [Promise; 18] = [
    promise(
        "Whatever comes over the wire, nothing panics and memory stays bounded.",
        "fuzz",
        "no_bytes_panic",
        Some("fuzz"),
    ),
    promise(
        "Whatever a capture, session file, configuration or map holds, nothing panics, each is read or refused within a second.",
        "fuzz",
        "no_file_panics",
        Some("fuzz"),
    ),
    promise(
        "A recording can be read after a kill at any moment; at most 100 ms are lost.",
        "kill",
        "what_was_recorded_before_a_kill_can_be_read",
        Some("kill"),
    ),
    promise(
        "A full disk holds up nothing; what waited is written when there is room again.",
        "full_disk",
        "a_full_disk_holds_up_nothing_and_costs_nothing",
        None,
    ),
    promise(
        "A disk full for long costs the end of that time, and bounded memory.",
        "recording",
        "a_disk_full_for_too_long_costs_the_end_of_that_time_and_bounded_memory",
        None,
    ),
    promise(
        "Short writes and failing ones cost nothing.",
        "recording",
        "short_writes_and_moods_that_change_each_second_cost_nothing",
        None,
    ),
    promise(
        "A recording keeps to its size and time, and leaves the disk the room that others need.",
        "recording",
        "the_room_that_others_need_is_left_to_them",
        None,
    ),
    promise(
        "Recordings are their owner's alone.",
        "recording",
        "recordings_are_their_owners_alone_and_leave_others_in_peace",
        None,
    ),
    promise("A recording replays bit for bit.", "live", "a_recording_replays_bit_for_bit", Some("soak")),
    promise("A hundred pulls of the plug are survived.", "replug", "a_hundred_replugs_are_survived", None),
    promise(
        "Map and pose go on when the port returns, under whatever name.",
        "link",
        "map_and_pose_go_on_when_the_port_returns_under_another_name",
        None,
    ),
    promise(
        "A board that restarts costs no pose.",
        "handshake",
        "a_board_that_restarts_in_mid_stream_costs_no_pose",
        None,
    ),
    promise(
        "Viewers that hang or never come are not in the way.",
        "viewer",
        "viewers_that_hang_or_never_come_are_not_in_the_way",
        None,
    ),
    promise(
        "Each kind of broken sensor is found in time, named, and forgiven when it passes.",
        "faults",
        "each_kind_is_found_in_time_and_named_and_forgiven_when_it_passes",
        None,
    ),
    promise("Healthy sensors stay trusted.", "faults", "healthy_sensors_stay_trusted", None),
    promise("A slip of the wheels is noticed, told and mended.", "lock", "a_slip_is_noticed_told_and_mended", None),
    promise("A damaged session file is refused with the cause.", "session_file", "each_damage_is_named", None),
    promise(
        "No sweep allocates; nothing grows with time.",
        "allocation",
        "no_sweep_allocates_with_the_walls_method",
        Some("soak"),
    ),
];
