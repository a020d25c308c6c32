//! Designs inside the program: what is run where no file is named, with the parts it includes.

use fusion::config::Files;

/// The design that is run where no file is named.
pub(super) const DESIGN: &str = include_str!("../../configs/ins-gps-outlier.toml");
/// What it is called.
pub(super) const NAME: &str = "ins-gps-outlier.toml (built in)";

macro_rules! parts {
    ($($path:literal)*) => {
        &[$(($path, include_str!(concat!("../../configs/", $path)))),*]
    };
}

/// Every part under configs/parts/, by its path from configs/.
pub(super) const PARTS: Files = Files::Embedded(FILES);

const FILES: &[(&str, &str)] = parts! {
    "parts/compass/tcm.toml"
    "parts/gnss/rtk.toml"
    "parts/gnss/single-frequency.toml"
    "parts/gnss/single-point.toml"
    "parts/imu/hg1700.toml"
    "parts/navigator/tracked.toml"
    "parts/usbl/moored-ship.toml"
    "parts/usbl/sea-trial.toml"
    "parts/vehicle/car.toml"
    "parts/vehicle/tracked.toml"
    "parts/vehicle/uri-r.toml"
    "parts/vehicle/utv.toml"
};

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn files(folder: &Path, found: &mut Vec<String>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                files(&path, found);
            } else {
                let inside = path.strip_prefix(Path::new(env!("CARGO_MANIFEST_DIR")).join("configs")).unwrap();
                found.push(inside.to_str().unwrap().replace('\\', "/"));
            }
        }
    }

    #[test]
    fn every_part_is_embedded() {
        let mut there = Vec::new();
        files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/parts"), &mut there);
        let mut embedded: Vec<&str> = FILES.iter().map(|(path, _)| *path).collect();
        there.sort_unstable();
        embedded.sort_unstable();
        assert_eq!(there, embedded);
    }
}
