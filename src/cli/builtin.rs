//! Built-in designs: the design that runs if no file is given, with its parts.

use fusion::config::Files;

/// The design that runs if no file is given.
pub(super) const DESIGN: &str = include_str!("../../configs/demonstration.toml");
/// Its name.
pub(super) const NAME: &str = "demonstration.toml (built in)";

macro_rules! files {
    ($($path:literal)*) => {
        &[$(($path, include_str!(concat!("../../configs/", $path)))),*]
    };
}

/// The files that it includes, by their paths from configs/.
pub(super) const INCLUDED: Files = Files::Embedded(FILES);

/// Every part under configs/parts/, with its text.
pub(super) fn parts() -> impl Iterator<Item = &'static (&'static str, &'static str)> {
    FILES.iter().filter(|(path, _)| path.starts_with("parts/"))
}

const FILES: &[(&str, &str)] = files! {
    "ins-gps-outlier.toml"
    "parts/barometer/bmp280.toml"
    "parts/compass/tcm.toml"
    "parts/depth/bar30.toml"
    "parts/dvl/a50.toml"
    "parts/dvl/workhorse-navigator.toml"
    "parts/gate/huber.toml"
    "parts/gate/hypotheses.toml"
    "parts/gate/nis.toml"
    "parts/gate/student-t.toml"
    "parts/gate/two-condition.toml"
    "parts/gnss/mosaic-x5-rtk.toml"
    "parts/gnss/neo-m8.toml"
    "parts/gnss/rtk.toml"
    "parts/gnss/single-frequency.toml"
    "parts/gnss/single-point.toml"
    "parts/gnss/smartphone.toml"
    "parts/gnss/trimble-5700-dgps.toml"
    "parts/gnss/trimble-5700-rtk.toml"
    "parts/gnss/zed-f9p-rtk.toml"
    "parts/gnss/zed-f9p-sbas.toml"
    "parts/gnss/zed-f9p.toml"
    "parts/imu/adis16405.toml"
    "parts/imu/adis16470.toml"
    "parts/imu/adis16488a.toml"
    "parts/imu/bmi088.toml"
    "parts/imu/hg1700.toml"
    "parts/imu/hg4930.toml"
    "parts/imu/hg9900.toml"
    "parts/imu/icm-20948.toml"
    "parts/imu/icm-42688-p.toml"
    "parts/imu/ln-200s.toml"
    "parts/imu/mti-300.toml"
    "parts/imu/mti-630.toml"
    "parts/imu/stim300.toml"
    "parts/imu/vn-100.toml"
    "parts/magnetometer/rm3100.toml"
    "parts/navigator/tracked.toml"
    "parts/usbl/moored-ship.toml"
    "parts/usbl/sea-trial.toml"
    "parts/usbl/trackpoint-ii.toml"
    "parts/vehicle/car.toml"
    "parts/vehicle/foot.toml"
    "parts/vehicle/husky.toml"
    "parts/vehicle/multicopter.toml"
    "parts/vehicle/otter.toml"
    "parts/vehicle/remus-100.toml"
    "parts/vehicle/tracked-navigators.toml"
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
            } else if path.extension().is_some_and(|e| e == "toml") {
                let inside = path.strip_prefix(Path::new(env!("CARGO_MANIFEST_DIR")).join("configs")).unwrap();
                found.push(inside.to_str().unwrap().replace('\\', "/"));
            }
        }
    }

    #[test]
    fn every_part_is_embedded() {
        let mut there = Vec::new();
        files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/parts"), &mut there);
        let mut embedded: Vec<&str> = parts().map(|(path, _)| *path).collect();
        there.sort_unstable();
        embedded.sort_unstable();
        assert_eq!(there, embedded);
    }
}
