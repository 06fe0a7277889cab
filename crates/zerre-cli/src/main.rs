//! The binary `zerre`: everything is in the library beside it, where tests reach it.
fn main() -> std::process::ExitCode {
    zerre_cli::main()
}
