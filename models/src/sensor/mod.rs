//! Measurement models, one file each.

mod gnss_position;
