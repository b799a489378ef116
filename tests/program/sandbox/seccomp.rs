//! A unit's system call filter as a program for the kernel (classic BPF), as systemd makes it of the same lines.

use super::unit::Unit;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

const LOAD: u16 = 0x20;
const JUMP_EQUAL: u16 = 0x15;
const JUMP_ANY_BIT: u16 = 0x45;
const RETURN: u16 = 0x06;
const AND: u16 = 0x54;
const ALLOW: u32 = 0x7FFF_0000;
const ERRNO: u32 = 0x0005_0000;
const EPERM: u32 = 1;
const ENOSYS: u32 = 38;
const EAFNOSUPPORT: u32 = 97;
/// Where the kernel puts a call's number, its machine, and its arguments (the lower halves), bytes.
const NUMBER: u32 = 0;
const MACHINE: u32 = 4;
const fn argument(i: u32) -> u32 {
    16 + 8 * i
}
const THIS_MACHINE: u32 = if cfg!(target_arch = "aarch64") { 0xC000_00B7 } else { 0xC000_003E };
/// CLONE_NEWNS, NEWCGROUP, NEWUTS, NEWIPC, NEWUSER, NEWPID, NEWNET, NEWTIME.
const NAMESPACES: u32 = 0x7E02_0080;

struct Program {
    numbers: BTreeMap<String, u32>,
    steps: Vec<(u16, u8, u8, u32)>,
}

/// The numbers of all system calls of this machine, from the C library's headers.
fn numbers() -> BTreeMap<String, u32> {
    let output = Command::new("cc").args(["-E", "-dM", "-include", "sys/syscall.h", "-x", "c", "/dev/null"]).output();
    let text = String::from_utf8(output.unwrap().stdout).unwrap();
    let number = |line: &str| {
        let (name, number) = line.strip_prefix("#define __NR_")?.split_once(' ')?;
        Some((name.to_owned(), number.parse().ok()?))
    };
    text.lines().filter_map(number).collect()
}

/// The calls of a group of systemd's, or one call.
fn calls(name: &str, into: &mut BTreeSet<String>) {
    if !name.starts_with('@') {
        into.insert(name.into());
        return;
    }
    let output = Command::new("systemd-analyze").args(["syscall-filter", "--no-pager", name]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let words = text.lines().skip(1).map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    words.for_each(|word| calls(word, into));
}

impl Program {
    fn step(&mut self, code: u16, if_true: u8, if_false: u8, value: u32) {
        self.steps.push((code, if_true, if_false, value));
    }

    /// Behind a call's name, these steps judge it; those that come to their end leave it to what follows.
    fn judge(&mut self, call: &str, steps: &[(u16, u8, u8, u32)]) {
        let Some(&number) = self.numbers.get(call) else { return };
        let length = u8::try_from(steps.len() + 1).unwrap();
        self.step(JUMP_EQUAL, 0, length, number);
        self.steps.extend_from_slice(steps);
        self.step(LOAD, 0, 0, NUMBER);
    }

    /// Refuses a call whose argument has one of these bits.
    fn refuse_bits(&mut self, call: &str, i: u32, bits: u32) {
        self.judge(call, &[(LOAD, 0, 0, argument(i)), (JUMP_ANY_BIT, 0, 1, bits), (RETURN, 0, 0, ERRNO | EPERM)]);
    }

    fn refuse(&mut self, call: &str, error: u32) {
        self.judge(call, &[(RETURN, 0, 0, ERRNO | error)]);
    }
}

fn families(unit: &Unit) -> Option<Vec<u32>> {
    let number = |name: &str| match name {
        "AF_UNIX" => 1,
        "AF_INET" => 2,
        "AF_INET6" => 10,
        "AF_NETLINK" => 16,
        "AF_PACKET" => 17,
        _ => panic!("{name}: not known here"),
    };
    unit.value("RestrictAddressFamilies").map(|names| names.split_whitespace().map(number).collect())
}

/// The calls that the unit allows by name; none where it does not say.
fn allowed(unit: &Unit) -> BTreeSet<String> {
    let mut allowed = BTreeSet::new();
    for line in unit.values("SystemCallFilter") {
        let (mut named, is_denied) = (BTreeSet::new(), line.starts_with('~'));
        line.trim_start_matches('~').split_whitespace().for_each(|name| calls(name, &mut named));
        allowed = if is_denied { &allowed - &named } else { &allowed | &named };
    }
    allowed
}

/// The filter, as bubblewrap reads it.
pub(super) fn program(unit: &Unit) -> Vec<u8> {
    let mut program = Program { numbers: numbers(), steps: Vec::new() };
    program.step(LOAD, 0, 0, MACHINE);
    program.step(JUMP_EQUAL, 1, 0, THIS_MACHINE);
    program.step(RETURN, 0, 0, ERRNO | EPERM);
    program.step(LOAD, 0, 0, NUMBER);
    if let Some(families) = families(unit) {
        let mut steps = vec![(LOAD, 0, 0, argument(0))];
        for (i, family) in families.iter().enumerate() {
            steps.push((JUMP_EQUAL, u8::try_from(families.len() - i).unwrap(), 0, *family));
        }
        steps.push((RETURN, 0, 0, ERRNO | EAFNOSUPPORT));
        program.judge("socket", &steps);
    }
    if unit.is("MemoryDenyWriteExecute") {
        // Writable and executable together; what was writable becoming executable.
        let both = [(LOAD, 0, 0, argument(2)), (AND, 0, 0, 6), (JUMP_EQUAL, 0, 1, 6), (RETURN, 0, 0, ERRNO | EPERM)];
        program.judge("mmap", &both);
        program.refuse_bits("mprotect", 2, 4);
        program.refuse_bits("pkey_mprotect", 2, 4);
    }
    if unit.is("RestrictRealtime") {
        let policy = [
            (LOAD, 0, 0, argument(1)),
            (JUMP_EQUAL, 2, 0, 1),
            (JUMP_EQUAL, 1, 0, 2),
            (JUMP_EQUAL, 0, 1, 6),
            (RETURN, 0, 0, ERRNO | EPERM),
        ];
        program.judge("sched_setscheduler", &policy);
    }
    if unit.is("RestrictNamespaces") {
        program.refuse_bits("unshare", 0, NAMESPACES);
        program.refuse_bits("clone", 0, NAMESPACES);
        program.refuse("clone3", ENOSYS);
        program.refuse("setns", EPERM);
    }
    if unit.is("RestrictSUIDSGID") {
        for (call, i) in [("chmod", 1), ("fchmod", 1), ("fchmodat", 2), ("mkdir", 1), ("mkdirat", 2)] {
            program.refuse_bits(call, i, 0o6000);
        }
        program.refuse("fchmodat2", ENOSYS);
    }
    if unit.is("LockPersonality") {
        let own = [
            (LOAD, 0, 0, argument(0)),
            (JUMP_EQUAL, 2, 0, 0),
            (JUMP_EQUAL, 1, 0, u32::MAX),
            (RETURN, 0, 0, ERRNO | EPERM),
        ];
        program.judge("personality", &own);
    }
    let allowed = allowed(unit);
    let mut other = ALLOW;
    if !allowed.is_empty() {
        let numbers: BTreeSet<u32> = allowed.iter().filter_map(|name| program.numbers.get(name).copied()).collect();
        assert!(numbers.len() > 100, "{allowed:?}");
        for number in numbers {
            program.step(JUMP_EQUAL, 0, 1, number);
            program.step(RETURN, 0, 0, ALLOW);
        }
        assert_eq!(unit.value("SystemCallErrorNumber"), Some("EPERM"));
        other = ERRNO | EPERM;
    }
    program.step(RETURN, 0, 0, other);
    let bytes = |&(code, if_true, if_false, value): &(u16, u8, u8, u32)| {
        [&code.to_ne_bytes()[..], &[if_true, if_false], &value.to_ne_bytes()].concat()
    };
    program.steps.iter().flat_map(bytes).collect()
}
