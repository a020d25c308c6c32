//! Runs this program inside valgrind, which counts from the beginning of [`counted_call`] to its end.

use std::collections::BTreeMap;
use std::fs;
use std::hint::black_box;
use std::path::Path;
use std::process::Command;

/// The argument of the program inside.
pub const INSIDE: &str = "--inside-valgrind";

const COUNTED: &str = concat!(module_path!(), "::counted_call");

/// The function whose name selects what valgrind counts.
#[inline(never)]
pub fn counted_call(work: &mut dyn FnMut()) {
    work();
    // The function must not end with a call: a tail call is a jump, and counting would stop too early.
    black_box(());
}

/// The kernel that ran, and the instructions per step of every work; or the reason why they are missing.
pub fn count() -> Result<(String, BTreeMap<String, u64>), String> {
    if !Command::new("valgrind")
        .arg("--version")
        .output()
        .is_ok_and(|out| out.status.success())
    {
        return Err("there is no valgrind".to_owned());
    }
    let folder = std::env::temp_dir().join(format!("fusion-instructions-{}", std::process::id()));
    fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let counts = run(&folder);
    let _ = fs::remove_dir_all(&folder);
    Ok(counts)
}

fn run(folder: &Path) -> (String, BTreeMap<String, u64>) {
    let file = folder.join("counts");
    let out = Command::new("valgrind")
        .args(["-q", "--tool=callgrind", "--collect-atstart=no"])
        // A pattern instead of the whole name counts and does not dump (3.19).
        .args([format!("--toggle-collect={COUNTED}"), format!("--dump-after={COUNTED}")])
        .arg(format!("--callgrind-out-file={}", file.display()))
        .arg(std::env::current_exe().expect("this program"))
        .arg(INSIDE)
        .output()
        .expect("valgrind is there");
    let errors = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "inside valgrind it failed: {errors}");
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    let mut lines = text.lines();
    let kernel = lines.next().expect("the kernel comes first").to_owned();
    let counts: BTreeMap<String, u64> = lines
        .enumerate()
        .map(|(k, line)| {
            let (steps, name) = line.split_once(' ').expect("steps and name");
            let dump = fs::read_to_string(folder.join(format!("counts.{}", k + 1))).expect("a dump for each work");
            let total = dump
                .lines()
                .find_map(|line| line.strip_prefix("totals: "))
                .expect("a dump has totals");
            let (total, steps): (u64, u64) = (total.trim().parse().unwrap(), steps.parse().unwrap());
            assert!(total > 0, "nothing was counted of {name}");
            (name.to_owned(), total / steps)
        })
        .collect();
    assert!(
        !folder.join(format!("counts.{}", counts.len() + 1)).exists(),
        "a dump for each work, and no other"
    );
    (kernel, counts)
}
