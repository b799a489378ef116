//! Files that slamd writes and reads: recordings, session files, ROS 2 bags.

mod full_disk;
mod kill;
mod recording;
mod resume;
mod ros2;
mod session_file;
