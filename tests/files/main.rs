//! Files that slamd writes and reads: recordings, session files, ROS 2 bags.

mod cases;
mod disk_errors;
mod failing_calls;
mod full_disk;
mod import_bag;
mod import_habits;
mod import_refusals;
mod kill;
mod links;
mod outputs;
mod power_cut;
mod recording;
mod resume;
mod ros2;
mod same_name;
mod session_file;
