//! The program as its user meets it: command line, monitor, doctor, service, package, manual.

mod book;
mod cli;
mod closed_pipe;
mod config_command;
mod doctor;
mod doctor_troubles;
mod drive_terminal;
mod manual;
mod monitor;
mod monitor_terminal;
mod package;
mod sandbox;
mod service;
mod setup;
mod setup_terminal;
mod setup_units;
mod startup;
mod systemd;
mod udev;
