//! Speed with its course, and impossible latitudes and longitudes.

use super::{T, said, values};

#[test]
fn a_speed_and_its_course_make_a_velocity_whose_columns_have_units_of_their_own() {
    let kn = 1852.0 / 3600.0;
    let close = |found: &[Vec<f64>], wanted: &[f64]| {
        assert_eq!(found[0].len(), wanted.len());
        for (a, b) in found[0].iter().zip(wanted) {
            // 1e-15 of 10: the sine of 180°, and rounding of the product.
            assert!((a - b).abs() < 1e-14, "{found:?} {wanted:?}");
        }
    };
    let text = "t,SOG,COG,VZ\n1,10,210,0.5\n";
    let (north, east) = (-10.0 * 30f64.to_radians().cos(), -10.0 * 30f64.to_radians().sin());
    let own = format!(
        "{T}channels.horizontal_velocity = {{ speed = {{ column = 'SOG', unit = 'kn' }}, course = {{ column = 'COG', unit = 'deg' }} }}"
    );
    close(&values(&own, text), &[north * kn, east * kn]);
    // The vertical speed has the unit of the horizontal speed, or a separate unit, and may be positive upwards.
    let down =
        format!("{T}channels.velocity = {{ speed = 'SOG', course = {{ column = 'COG', unit = 'deg' }}, down = 'VZ', unit = 'm/s' }}");
    close(&values(&down, text), &[north, east, 0.5]);
    let up = down.replace("down = 'VZ'", "up = { column = 'VZ', unit = 'cm/s' }");
    close(&values(&up, text), &[north, east, -0.005]);
    let header = format!("{T}channels.velocity = {{ speed = 'v (kn)', course = 'c [deg]', down = 'd (m/s)' }}");
    close(&values(&header, "t,v (kn),c [deg],d (m/s)\n1,10,90,2\n"), &[0.0, 10.0 * kn, 2.0]);
    let same = format!("{T}channels.velocity = {{ speed = 'v (kn)', course = 'c [deg]', down = 'd' }}");
    close(&values(&same, "t,v (kn),c [deg],d\n1,10,-90,2\n"), &[0.0, -10.0 * kn, 2.0 * kn]);
    // At rest any course is accepted; an empty course gives no velocity if `valid` excludes it.
    close(&values(&own, "t,SOG,COG\n1,0,359.9\n"), &[0.0, 0.0]);
    let empty = own.replace("'deg' } }", "'deg' }, valid = { column = 'COG', not_equals = '' } }");
    assert!(values(&empty, "t,SOG,COG\n1,0.1,\n")[0].iter().all(|v| v.is_nan()));
}

#[test]
fn what_a_speed_with_its_course_misses_is_said() {
    let of = |channel: &str| said(&format!("{T}channels.{channel}"), "t,s,c,d\n1,1,1,1\n");
    let three = of("velocity = { speed = 's', course = 'c', unit = 'm/s' }");
    assert!(
        three.contains("this channel misses `down`") && three.contains("call the channel `horizontal_velocity`"),
        "{three}"
    );
    let two = of("horizontal_velocity = { speed = { column = 's', unit = 'kn' }, course = { column = 'c', unit = 'deg' }, down = 'd' }");
    assert!(
        two.contains("a `horizontal_velocity` has no `down`") && two.contains("call the channel `velocity`"),
        "{two}"
    );
    let units = of("horizontal_velocity = { speed = 's', course = 'c' }");
    assert!(
        units.contains("a speed needs its unit") && units.contains("a course needs its unit"),
        "{units}"
    );
    let course = of("horizontal_velocity = { speed = { column = 's', unit = 'deg' }, course = { column = 'c', unit = 'kn' } }");
    assert_eq!(course.matches("is the unit of").count(), 2, "{course}");
    let missing = of("horizontal_velocity = { speed = { column = 'v', unit = 'kn' }, course = { column = 'c', unit = 'deg' } }");
    assert!(missing.contains("has no column `v`"), "{missing}");
    let alone = of("horizontal_velocity = { course = { column = 'c', unit = 'deg' } }");
    assert!(alone.contains("this channel misses `speed`"), "{alone}");
    let sigma = of("velocity_sigma = { speed = 's', course = 'c', down = 'd', unit = 'm/s' }");
    assert!(sigma.contains("has no course"), "{sigma}");
    let key = of("horizontal_velocity = { speed = { column = 's', units = 'kn' }, course = 'c' }");
    assert!(
        key.contains("unknown field `units`") && key.contains("did you mean `unit`"),
        "{key}"
    );
}

#[test]
fn degrees_and_minutes_are_read_as_nmea_writes_them() {
    let toml = format!("{T}channels.horizontal_position = {{ latitude = 'lat', longitude = '-lon', unit = 'ddmm' }}");
    let found = values(&toml, "t,lat,lon\n1,4854.554,13036.442\n2,-0030.6,-00030.6\n");
    let degrees = |degrees: f64| degrees.to_radians();
    let wanted = [
        [degrees(48.0 + 54.554 / 60.0), degrees(-130.0 - 36.442 / 60.0)],
        [degrees(-0.51), degrees(0.51)],
    ];
    for (a, b) in found.iter().flatten().zip(wanted.iter().flatten()) {
        // 1e-12 of a minute is lost where hundreds are taken off.
        assert!((a - b).abs() < 1e-15, "{found:?} {wanted:?}");
    }
    let minutes = said(&toml, "t,lat,lon\n1,4854.554,0\n2,4860,0\n");
    assert!(
        minutes.starts_with("error: `4860` in column `lat` has 60 minutes or more\n--> log.csv:3"),
        "{minutes}"
    );
    let pole = said(&toml, "t,lat,lon\n1,9130,0\n");
    assert!(
        pole.starts_with("error: 9130 (degrees and minutes) in column `lat` is not a latitude: it lies beyond a pole\n--> log.csv:2"),
        "{pole}"
    );
}

#[test]
fn a_place_that_cannot_be_is_an_error_that_says_what_it_may_be() {
    let of = |unit: &str, cells: &str| {
        let toml = format!("{T}channels.horizontal_position = {{ latitude = 'lat', longitude = 'lon', unit = '{unit}' }}");
        said(&toml, &format!("t,lat,lon\n1,{cells}\n"))
    };
    for (unit, cells, what, instead) in [
        (
            "deg",
            "4854.554,-13036.442",
            "4854.554 deg in column `lat` is not a latitude: it lies beyond a pole",
            "write `unit = \"ddmm\"`",
        ),
        (
            "deg",
            "48,13036.442",
            "13036.442 deg in column `lon` is not a longitude: it is more than a turn",
            "write `unit = \"ddmm\"`",
        ),
        (
            "deg",
            "-130.6,48.9",
            "-130.6 deg in column `lat` is not a latitude: it lies beyond a pole",
            "are latitude and longitude exchanged? To leave",
        ),
        (
            "rad",
            "48.9,-130.6",
            "48.9 rad in column `lat` is not a latitude: it lies beyond a pole",
            "write `unit = \"deg\"`; to leave",
        ),
        (
            "deg",
            "489000000,1",
            "489000000 deg in column `lat` is not a latitude: it lies beyond a pole",
            "help: to leave such rows out",
        ),
    ] {
        let told = of(unit, cells);
        assert!(told.starts_with(&format!("error: {what}\n--> log.csv:2")), "{told}");
        assert!(told.contains(instead), "{told}");
    }
    let toml = format!("{T}channels.horizontal_position = {{ latitude = 'lat', longitude = 'lon', unit = 'deg' }}");
    assert_eq!(values(&toml, "t,lat,lon\n1,-90,360\n").len(), 1);
}
