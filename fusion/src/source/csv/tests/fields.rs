//! Contents of rows and headers: blanks, names within comments, sums, units of the header.

use super::{T, said, values};

const BLANKS: &str = "delimiter = 'blanks'\ncomment = '#'\n";

#[test]
fn fields_between_runs_of_blanks_are_read() {
    let toml = format!("{BLANKS}{T}channels.v = {{ columns = ['v', 'w'], unit = 'm/s' }}");
    let text = "# made by x\n   t \t v    w\n  1   2   3  \r\n\n# pause\n\t2\t4\t5\n   # pause\n 3 6 7";
    assert_eq!(values(&toml, text), [[2.0, 3.0], [4.0, 5.0], [6.0, 7.0]]);
    let wrong = said(&toml, "t v w\n1 2 3\n\n   2    4\n");
    assert!(wrong.starts_with("error: this row has 2 fields, not 3\n--> log.csv:4"), "{wrong}");
    let two = said(&format!("delimiter = ', '\n{T}"), "t\n1\n");
    assert!(
        two.contains("this is one plain character") && two.contains("delimiter = \"blanks\""),
        "{two}"
    );
}

#[test]
fn the_last_comment_before_the_rows_may_name_the_columns() {
    let channels = format!("{T}channels.v = {{ column = 'v', unit = 'm/s' }}");
    let toml = format!("header = 'comment'\n{BLANKS}{channels}");
    let text = "# a log\n\n## t   v\n1 2\n# pause\n2 x\n";
    let wrong = said(&toml, text);
    assert!(
        wrong.starts_with("error: `x` in column `v` is not a number\n--> log.csv:6"),
        "{wrong}"
    );
    assert_eq!(values(&toml, "# a log\n#  t   v\n1 2\n# pause\n3  4\n"), [[2.0], [4.0]]);
    let commas = format!("header = 'comment'\ncomment = '%'\n{channels}");
    assert_eq!(values(&commas, "% t, v\n1, 2\n"), [[2.0]]);
    let missing = said(&toml, "1 2\n");
    assert!(
        missing.starts_with("error: no comment before the first row names the columns\n--> log.csv"),
        "{missing}"
    );
    let mark = said(&format!("header = 'comment'\n{channels}"), "# t v\n");
    assert!(mark.contains("needs the character that begins comments"), "{mark}");
}

#[test]
fn a_number_may_be_the_sum_of_columns() {
    let toml = format!(
        "{T}[channels]
        a = {{ column = ['l', 'r'], unit = 'm/s', scale = 0.5 }}
        b = {{ columns = [['l', '-r'], 'r'], unit = 'm/s' }}"
    );
    assert_eq!(
        values(&toml, "t,l,r\n1,3,-1\n2,0.5,0.25\n"),
        [[1.0, 4.0, -1.0], [0.375, 0.25, 0.25]]
    );
    let wrong = said(&toml, "t,l,r\n1,3,x\n");
    assert!(
        wrong.starts_with("error: `x` in column `r` is not a number\n--> log.csv:2"),
        "{wrong}"
    );
    let missing = said(&toml, "t,l\n1,3\n");
    assert!(missing.contains("has no column `r`"), "{missing}");
    let empty = said(&format!("{T}channels.a = {{ columns = ['l', []] }}"), "t,l\n1,3\n");
    assert!(empty.contains("this sum names no column"), "{empty}");
}

#[test]
fn a_value_may_be_excluded() {
    let toml = |valid: &str| format!("valid = {valid}\n{T}channels.v = {{ column = 'v', unit = 'm/s' }}");
    let text = "t,v,q\n1,1,0\n2,2,1\n3,3,A\n4,4,5\n";
    assert_eq!(values(&toml("{ column = 'q', not_equals = [0, 'A'] }"), text), [[2.0], [4.0]]);
    assert_eq!(
        values(
            &toml("{ column = 'q', not_equals = ['A', 0.0], at_most = 2 }"),
            &text.replace('A', "0")
        ),
        [[2.0]]
    );
    let number = said(&toml("{ column = 'q', not_equals = 0 }"), text);
    assert!(
        number.starts_with("error: `A` in column `q` is not a number\n--> log.csv:4"),
        "{number}"
    );
}

#[test]
fn the_unit_in_brackets_of_a_header_is_that_of_the_channel() {
    let toml = "
        time = { column = 't [ms]' }
        [channels]
        a = { columns = ['gx (deg/s)', '-gy [deg/s]'] }
        b = { latitude = 'lat(deg)', longitude = 'lon(deg)', height = 'alt [km]' }
        c = { column = 'p [hPa]', unit = '' }
        d = { column = 'n [counts]' }
        e = { rpy = ['r(deg)', 'p(deg)', 'y(deg)'] }";
    let (rows, _) = super::read(
        toml,
        b"t [ms],gx (deg/s),gy [deg/s],lat(deg),lon(deg),alt [km],p [hPa],n [counts],r(deg),p(deg),y(deg)\n1500,180,90,45,90,2,3,4,0,0,180\n",
    )
    .unwrap();
    let pi = std::f64::consts::PI;
    let expected = [pi, -pi / 2.0, pi / 4.0, pi / 2.0, 2000.0, 3.0, 4.0, 0.0, 0.0, 0.0, 1.0];
    assert_eq!(rows[0].0, 1_500_000_000);
    for (found, expected) in rows[0].1.iter().zip(expected) {
        // ε: rounding of the factor; a half turn has cos(π/2) = 6e-17.
        assert!(
            (found - expected).abs() <= 3e-16 * expected.abs().max(1.0),
            "{found} for {expected}"
        );
    }
    let mixed = said(
        &format!("{T}channels.v = {{ columns = ['x [m]', 'y [cm]'] }}"),
        "t,x [m],y [cm]\n1,1,1\n",
    );
    assert!(mixed.contains("the columns `x [m]` and `y [cm]` state different units"), "{mixed}");
}

#[test]
fn fields_of_a_magnetometer_and_temperatures_are_read() {
    let toml = format!(
        "{T}[channels]
        magnetic_field = {{ columns = ['mx', 'my', 'mz'], unit = 'uT' }}
        t_celsius = {{ column = 'temp', unit = 'K', offset = '273.15 K' }}
        t_kelvin = {{ column = 'tk [K]' }}"
    );
    let found = values(&toml, "t,mx,my,mz,temp,tk [K]\n1,20,-5,43.5,26.85,300\n");
    for (found, expected) in found[0].iter().zip([20e-6, -5e-6, 43.5e-6, 300.0, 300.0]) {
        // ε: rounding of the factor and of the sum.
        assert!(
            (found - expected).abs() <= 2.0 * f64::EPSILON * expected.abs(),
            "{found} for {expected}"
        );
    }
}

#[test]
fn a_name_that_stands_twice_is_an_error_where_it_is_used_and_a_number_tells_columns_apart() {
    let toml = format!("{T}channels.v = {{ columns = ['a', '-b'], unit = 'm/s' }}");
    let text = "t,a,b,a,c,c\n1,2,3,4,5,5\n";
    let twice = said(&toml, text);
    assert!(twice.starts_with("error: `log.csv` has 2 columns `a`\n"), "{twice}");
    assert!(
        twice.contains("instead of its name: `2` or `4`. Or name all columns by `names`") && twice.contains("`skip = 1`"),
        "{twice}"
    );
    assert_eq!(values(&toml.replace("'a'", "'4'").replace("'-b'", "'-3'"), text), [[4.0, -3.0]]);
    assert_eq!(
        values(&format!("skip = 1\nnames = ['t', 'a', 'b', 'x', 'y', 'z']\n{toml}"), text),
        [[2.0, -3.0]]
    );
    let beyond = said(&toml.replace("'a'", "'7'"), text);
    assert!(beyond.contains("has no column `7`"), "{beyond}");
    // A name has priority over a number.
    let number = format!("{T}channels.v = {{ column = '2', unit = 'm/s' }}");
    assert_eq!(values(&number, "t,a,2\n1,5,6\n"), [[6.0]]);
    let thrice = said(&toml.replace("'-b'", "'a', '-a'"), text);
    assert_eq!(thrice.matches("has 2 columns").count(), 1, "{thrice}");
    let time = said("time = { column = 't' }", "t,t\n1,2\n");
    assert!(time.starts_with("error: `log.csv` has 2 columns `t`\n"), "{time}");
}

#[test]
fn lines_before_and_after_a_header_are_passed_over() {
    let channels = format!("{T}channels.v = {{ column = 'v', unit = 'm/s' }}");
    let text = "made by \"x\nt,t,t\nt,v\ns,m/s\n\n1,2\n2,x\n";
    let wrong = said(&format!("header = 3\nskip = 1\n{channels}"), text);
    assert!(
        wrong.starts_with("error: `x` in column `v` is not a number\n--> log.csv:7"),
        "{wrong}"
    );
    assert_eq!(
        values(&format!("header = 3\nskip = 1\n{channels}"), "a\nb\nt,v\ns,m/s\n1,2\n"),
        [[2.0]]
    );
    assert_eq!(values(&format!("skip = 1\n{channels}"), "t,v\ns,m/s\n1,2\n"), [[2.0]]);
    assert_eq!(
        values(&format!("names = ['t', 'v']\nskip = 2\n{channels}"), "x,y\ns,m/s\n1,2\n"),
        [[2.0]]
    );
    let numbered = "header = false\nskip = 1\ntime = { column = '1' }\nchannels.v = { column = '2', unit = 'm/s' }";
    assert_eq!(values(numbered, "x,y\n1,2\n"), [[2.0]]);
    let comment = format!("header = 'comment'\nskip = 1\ncomment = '#'\n{channels}");
    assert_eq!(values(&comment, "# log\n# t,v\ns,m/s\n1,2\n"), [[2.0]]);
    let both = said(&format!("names = ['t', 'v']\nheader = 2\n{channels}"), "t,v\n1,2\n");
    assert!(both.contains("`names` stand instead of a header"), "{both}");
    assert!(said(&format!("header = 0\n{channels}"), "t,v\n1,2\n").contains("or the number of a line"));
    assert!(said("header = false\nskip = 5\ntime = { column = '1' }", "1\n2\n").contains("this file is empty"));
}

#[test]
fn comments_may_begin_with_more_than_one_character() {
    let toml = format!("comment = '//'\n{T}channels.v = {{ column = 'v', unit = 'm/s' }}");
    let wrong = said(&toml, "// a \"log\n//\nt,v\n// pause\n1,2\n/1,2\n");
    assert!(
        wrong.starts_with("error: `/1` in column `t` is not a number\n--> log.csv:6"),
        "{wrong}"
    );
    let named = format!("header = 'comment'\ndelimiter = 'blanks'\n{toml}");
    assert_eq!(values(&named, "// x\n// t v\n1  2\n// pause\n 2 3\n"), [[2.0], [3.0]]);
    assert!(said(&toml.replace("//", ""), "t,v\n").contains("this is what comments begin with"));
}
