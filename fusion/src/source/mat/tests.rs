//! Files of SciPy, hand-made bytes for types that it does not write, and a real recording with its converted copy.

use super::format::variables;
use super::*;
use crate::source::testing::recorded::{Rows, rows, spec};
use proptest::prelude::*;
use std::path::Path;

/// SciPy 1.17.1, `savemat(name, arrays, do_compression=…, oned_as="column")` of, for samples k = 0 … 4: `t` = k/100;
/// `t_ns` = 1752003258000000001 + k·10⁷, int64; `counter` = k; structure `imu` with `acc[k, c]` = k + c/4,
/// `gyro[c, k]` = c + k/2 in single precision, `rate` = 100, `unit` = "g", structure `more` with `temp` = 20 + k,
/// int16; `R` of 3×3×5 = 0, 1, …, the first index the fastest; `gps` = [1 2; 3 4], a cell array `cells`, complex
/// `z` and logical `flag` = (k is even).
const PACKED: &[u8] = include_bytes!("tests/packed.mat");
const PLAIN: &[u8] = include_bytes!("tests/plain.mat");

fn read(name: &str, file: &[u8], toml: &str) -> Result<Rows, String> {
    let dir = std::env::temp_dir().join(format!("fusion-mat-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    std::fs::write(dir.join("log.mat"), file).unwrap();
    let found = rows(&spec::<MatSpec>(&format!("path = 'log.mat'\n{toml}")), &dir);
    std::fs::remove_dir_all(&dir).unwrap();
    found.map_err(|e| e.replace(&format!("{}/", dir.display()), ""))
}

#[test]
fn samples_lie_in_rows_columns_and_pages_of_arrays_and_of_structures() {
    let toml = "
        time = { column = 't' }
        valid = { column = 'flag', equals = 1 }
        [channels]
        specific_force = { columns = ['imu.acc(:,1)', '-imu.acc(:,2)', 'imu.acc(:,3)'] }
        angular_rate = { columns = ['imu.gyro(1,:)', 'imu.gyro(2,:)', 'imu.gyro(3,:)'] }
        temperature = { column = 'imu.more.temp' }
        matrix = { columns = ['R(1,1,:)', 'R(3,1,:)', 'R(2,3,:)'] }";
    let wanted: Rows = [0.0, 2.0, 4.0]
        .map(|k| {
            let matrix = [9.0 * k, 9.0 * k + 2.0, 9.0 * k + 7.0];
            let (force, rate) = ([k, -k - 0.25, k + 0.5], [k / 2.0, 1.0 + k / 2.0, 2.0 + k / 2.0]);
            ((k * 1e7) as i64, [&rate[..], &matrix, &force, &[20.0 + k]].concat())
        })
        .into();
    assert_eq!(read("packed", PACKED, toml).unwrap(), wanted);
    assert_eq!(read("plain", PLAIN, toml).unwrap(), wanted);
}

#[test]
fn stamps_are_exact_and_may_be_left_out() {
    let value = "channels.speed = { column = 'counter' }";
    let exact = read(
        "exact",
        PACKED,
        &format!("time = {{ column = 't_ns', unit = 'ns', epoch = 1752003258000000000 }}\n{value}"),
    );
    let stamps = |rows: Rows| rows.into_iter().map(|(stamp, _)| stamp).collect::<Vec<_>>();
    assert_eq!(stamps(exact.unwrap()), [1, 10_000_001, 20_000_001, 30_000_001, 40_000_001]);
    let even = read("even", PLAIN, &format!("time = {{ rate = '300 Hz' }}\n{value}"));
    assert_eq!(stamps(even.unwrap()), [0, 3_333_333, 6_666_667, 10_000_000, 13_333_333]);
}

#[test]
fn what_is_no_column_is_said_of_each_array() {
    let said = |column: &str| {
        let toml = format!("time = {{ column = 't' }}\nchannels.speed = {{ column = \"{column}\" }}");
        read("absent", PLAIN, &toml).unwrap_err()
    };
    for (column, what) in [
        (
            "gps(:,1)",
            "`gps` is 2×2, which is not a column of 5 samples: give it its own source",
        ),
        ("imu.acc(1,:)", "`imu.acc` is 5×3"),
        ("imu.unit", "`imu.unit` is text, not an array of numbers"),
        ("cells", "`cells` is a cell array"),
        ("z", "`z` is an array of complex numbers"),
    ] {
        assert!(said(column).contains(what), "{column}: {}", said(column));
    }
    let (value, both) = ("channels.speed = { column = 'counter' }", "time = { column = 't', rate = '1 Hz' }");
    assert!(
        read("both", PLAIN, &format!("{both}\n{value}"))
            .unwrap_err()
            .contains("a sample has its stamp in an array, or samples are evenly spaced")
    );
}

#[test]
fn what_is_no_sound_file_is_said() {
    let said = |file: &[u8]| read("unsound", file, "time = { column = 't' }\nchannels.speed = { column = 't' }").unwrap_err();
    let mut hdf = PLAIN.to_vec();
    hdf[..10].copy_from_slice(b"MATLAB 7.3");
    assert!(
        said(&hdf).contains("log.mat: this file was saved with `-v7.3`, as HDF5: save it with `-v7`"),
        "{}",
        said(&hdf)
    );
    assert!(said(b"t,x\n1,2\n").contains("no MAT-file of version 5"));
    assert!(
        said(&PLAIN[..200]).contains("byte 128: the file is cut off here"),
        "{}",
        said(&PLAIN[..200])
    );
    assert!(said(&PACKED[..PACKED.len() - 8]).contains("cut off here"));
    let mut damaged = PACKED.to_vec();
    damaged[150] ^= 0x55;
    assert!(
        said(&damaged).contains("byte 128: a compressed array is damaged"),
        "{}",
        said(&damaged)
    );
}

/// An element, padded; in either byte order.
fn element(is_big: bool, kind: u32, data: &[u8]) -> Vec<u8> {
    let whole = |v: u32| if is_big { v.to_be_bytes() } else { v.to_le_bytes() };
    let mut bytes = [whole(kind), whole(data.len() as u32)].concat();
    bytes.extend_from_slice(data);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

/// A file of a row of three numbers `v` and an object `when`, as MATLAB writes a datetime.
fn by_hand(is_big: bool) -> Vec<u8> {
    let whole = |v: u32| if is_big { v.to_be_bytes() } else { v.to_le_bytes() };
    let element = |kind, data: &[u8]| element(is_big, kind, data);
    let numbers: Vec<u8> = [0.5_f64, -1.0, 2.0]
        .iter()
        .flat_map(|v| if is_big { v.to_be_bytes() } else { v.to_le_bytes() })
        .collect();
    let flags = |class| element(6, &[whole(class), whole(0)].concat());
    let shape = element(5, &[whole(1), whole(3)].concat());
    let array = [flags(6), shape, element(1, b"v"), element(9, &numbers)].concat();
    let object = [flags(17), element(1, b"when"), element(1, b"MCOS"), element(1, b"datetime")].concat();
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(124, b' ');
    file.extend_from_slice(if is_big { &[1, 0, b'M', b'I'] } else { &[0, 1, b'I', b'M'] });
    file.extend(element(14, &object));
    file.extend(element(14, &array));
    file
}

#[test]
fn files_of_either_byte_order_and_with_objects_are_read() {
    for is_big in [false, true] {
        let found = variables(&by_hand(is_big)).unwrap();
        assert_eq!(found.len(), 2);
        assert_eq!(
            (found[0].name.as_str(), &found[0].content),
            ("when", &Content::Other("an object, such as a table or a datetime"))
        );
        let wanted = Variable {
            name: "v".to_owned(),
            shape: vec![1, 3],
            content: Content::Numbers(vec![0.5, -1.0, 2.0]),
        };
        assert_eq!(found[1], wanted);
    }
}

proptest! {
    #[test]
    fn no_damage_is_worse_than_an_error(at in 124..PLAIN.len(), value: u8, end in 0..PLAIN.len()) {
        let mut file = PLAIN.to_vec();
        file[at] = value;
        for file in [&file[..], &file[..end]] {
            let sound = variables(file).unwrap_or_default();
            let samples = Samples::new(sound, "t", None);
            prop_assert_eq!(samples.columns.len(), samples.places.len());
            let mut samples = samples;
            while samples.advance().unwrap() {
                for column in 0..samples.columns.len() {
                    samples.cell(column);
                }
            }
        }
    }
}

/// BROAD, trial 02: other software made its CSV from the same file, with seven digits.
#[test]
fn a_recorded_file_is_that_which_was_made_of_it_by_hand() {
    let data = std::env::var_os("FUSION_DATA").unwrap_or_else(|| "../../shared/data".into());
    let data = Path::new(&data).join("broad_ahrs");
    if !data.exists() {
        eprintln!("skipped: {} is not there", data.display());
        return;
    }
    let columns = |of: &str, own: &str| {
        let of_mat = ["1", "2", "3"].map(|k| format!("'{of}(:,{k})'")).join(", ");
        let of_csv = ["x", "y", "z"].map(|k| format!("'{own}_{k}'")).join(", ");
        (format!("[{of_mat}]"), format!("[{of_csv}]"))
    };
    let (gyro, acc, mag) = (columns("imu_gyr", "gyr"), columns("imu_acc", "acc"), columns("imu_mag", "mag"));
    let channels = |gyro: &str, acc: &str, mag: &str, moving: &str| {
        format!(
            "[channels]
            angular_rate = {{ columns = {gyro}, unit = 'rad/s' }}
            specific_force = {{ columns = {acc}, unit = 'm/s^2' }}
            magnetic_field = {{ columns = {mag}, unit = 'uT' }}
            moving = {{ column = '{moving}' }}"
        )
    };
    let mat = channels(&gyro.0, &acc.0, &mag.0, "movement");
    let mat = format!("path = 'original/02_undisturbed_slow_rotation_B.mat'\ntime.rate = '285.7142857142857 Hz'\n{mat}");
    let csv = channels(&gyro.1, &acc.1, &mag.1, "moving");
    let csv = format!("path = 'derived/02.csv.gz'\ntime = {{ column = 't_s' }}\n{csv}");
    let mat = rows(&spec::<MatSpec>(&mat), &data).unwrap();
    let csv = rows(&spec::<crate::source::CsvSpec>(&csv), &data).unwrap();
    assert_eq!((mat.len(), csv.len()), (53_240, 53_240));
    for ((at, found), (stamp, wanted)) in mat.iter().zip(&csv) {
        // The stamps of the CSV have six digits after the point, its values seven.
        assert!((at - stamp).abs() <= 500, "{at} {stamp}");
        for (found, wanted) in found.iter().zip(wanted) {
            assert!((found - wanted).abs() <= 5.1e-7 * wanted.abs(), "{at}: {found} {wanted}");
        }
    }
}
