//! ATE and RPE of a recorded log against figures of evo.
//!
//! The data are those of `real.rs`; without them these tests say so and pass. The figures are those of
//!
//! ```text
//! cargo run --example tum -- configs/real/tumvi.toml OUT DATA
//! evo_ape tum OUT/reference.tum OUT/estimate.tum -r trans_part [--align]          (and -r angle_deg)
//! evo_rpe tum OUT/reference.tum OUT/estimate.tum -r trans_part -d 10 -u m [--all_pairs]
//! ```
//!
//! of evo 1.38.1, with all digits from `python3 by_evo.py OUT/reference.tum OUT/estimate.tum`, which also aligns in yaw
//! alone. The stamps of both files are equal: evo associates by the nearest, here the estimate is carried to the
//! reference's.

use super::real::real;
use fusion::score::trajectory::Statistics;

/// RMSE, mean, median, standard deviation, minimum and maximum.
fn assert_is(what: &str, found: &Statistics, count: usize, evo: [f64; 6]) {
    let six = [found.rmse, found.mean, found.median, found.std, found.min, found.max];
    assert_eq!(found.count, count, "{what}: {found:?}");
    for (found, evo) in six.iter().zip(evo) {
        // 1e-6 of m or deg: figures of the filter may differ in the ninth digit between processors; so small an
        // angle evo takes from a matrix, with half of the digits.
        assert!((found - evo).abs() < 1e-6, "{what}: {six:?} is not {evo:?}");
    }
}

#[test]
fn a_room_walked_through_has_the_errors_that_evo_finds() {
    let consecutive = r#"reference.trajectory={ distances = ["1 m", "10 m"] }"#;
    let Some(summary) = real("tumvi", &[], &[consecutive]) else {
        return;
    };
    let found = summary.score().unwrap().trajectory.as_ref().unwrap();
    let all = r#"reference.trajectory={ distances = ["1 m", "10 m"], pairs = "all" }"#;
    let overlapping = real("tumvi", &[], &[all]).unwrap();
    let overlapping = overlapping.score().unwrap().trajectory.as_ref().unwrap();
    assert_eq!(found.absolute.len(), 3);
    for (error, (metres, degrees)) in found.absolute.iter().zip(ABSOLUTE) {
        assert_is("ATE", &error.position, found.poses, metres);
        assert_is("ATE", &error.rotation_deg.unwrap(), found.poses, degrees);
    }
    let relative = found.relative.iter().chain(&overlapping.relative);
    let mut compared = 0;
    for (error, (count, metres, degrees)) in relative.zip(RELATIVE) {
        assert_is("RPE", &error.position, count, metres);
        assert_is("RPE", &error.rotation_deg.unwrap(), count, degrees);
        compared += 1;
    }
    assert_eq!(compared, 4);
}

/// ATE without alignment, in yaw and position, SE(3): metres, degrees.
const ABSOLUTE: [([f64; 6], [f64; 6]); 3] = [
    (
        [
            0.0652720494905,
            0.0595768551051,
            0.057042586713,
            0.0266653104326,
            0.00597851728584,
            0.173668661237,
        ],
        [
            0.724068377599,
            0.554453504965,
            0.444046097357,
            0.465678350657,
            0.0140572067611,
            5.81695763632,
        ],
    ),
    (
        [
            0.0650701299069,
            0.0595118794362,
            0.0569408122714,
            0.0263145969393,
            0.00197994918548,
            0.16996882154,
        ],
        [
            0.727585477455,
            0.554722146374,
            0.439604901946,
            0.470812029717,
            0.0219680219208,
            5.79750641959,
        ],
    ),
    (
        [
            0.0648974627227,
            0.0593594414209,
            0.0566071552732,
            0.0262323727872,
            0.000777785430389,
            0.169079045494,
        ],
        [
            0.755850607058,
            0.596893284135,
            0.487713933302,
            0.463711707361,
            0.0215321792989,
            6.0769119519,
        ],
    ),
];

/// RPE over 1 m and 10 m, consecutive, then all: pairs, metres, degrees.
const RELATIVE: [(usize, [f64; 6], [f64; 6]); 4] = [
    (
        154,
        [
            0.0626831643898,
            0.0544641354534,
            0.0497086941449,
            0.0310296156475,
            0.00691214495071,
            0.234620281721,
        ],
        [
            0.687979447781,
            0.516262973767,
            0.391604878807,
            0.454739774471,
            0.0521015905941,
            3.13322208691,
        ],
    ),
    (
        15,
        [
            0.0893388031755,
            0.0830795130976,
            0.0880363233091,
            0.0328514270054,
            0.0437960894864,
            0.143598145913,
        ],
        [
            1.33799736584,
            0.862456682745,
            0.578869524805,
            1.02293959811,
            0.221907028524,
            4.52202025259,
        ],
    ),
    (
        15520,
        [
            0.0637280883733,
            0.0558623990472,
            0.0495344662927,
            0.0306702073747,
            0.000935034875595,
            0.281839076374,
        ],
        [
            0.61171120099,
            0.470315132026,
            0.365703204764,
            0.391144819732,
            0.0107194612869,
            5.93524013776,
        ],
    ),
    (
        14650,
        [
            0.0940809789755,
            0.0863818629081,
            0.0819540020781,
            0.0372747148282,
            0.00415109962454,
            0.249678091441,
        ],
        [
            1.0037419018,
            0.720081822086,
            0.54821389952,
            0.699271031092,
            0.00156278227865,
            6.00755355592,
        ],
    ),
];
