//! Prints the page, for `cargo xtask web`.

fn main() {
    print!("{}", rc10_cli::live::Web::page());
}
