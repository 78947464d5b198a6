//! Tells the linker where the memory map is: at the top of the checkout.

fn main() {
    println!("cargo:rustc-link-search={}/../..", env!("CARGO_MANIFEST_DIR"));
    println!("cargo:rerun-if-changed=../../memory.x");
}
