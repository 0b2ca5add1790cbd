//! Hands the memory map to the linker and the optimisation level to the program.

fn main() {
    let folder = std::env::var("CARGO_MANIFEST_DIR").expect("set by cargo");
    let level = std::env::var("OPT_LEVEL").expect("set by cargo");
    println!("cargo:rustc-link-search={folder}");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-env=OPT_LEVEL={level}");
    println!("cargo:rerun-if-changed=memory.x");
}
