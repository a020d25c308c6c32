//! The memory of an STM32H743: code in the flash, data in the fast memory of the processor, which has 128 kB.

use std::{env, error::Error, fs, path::PathBuf};

const MEMORY: &str = "MEMORY { FLASH : ORIGIN = 0x08000000, LENGTH = 2M  RAM : ORIGIN = 0x20000000, LENGTH = 128K }\n";

fn main() -> Result<(), Box<dyn Error>> {
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out.join("memory.x"), MEMORY)?;
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-link-arg=-Tlink.x");
    println!("cargo:rerun-if-changed=build.rs");
    Ok(())
}
