// SPDX-License-Identifier: MPL-2.0

//! The program; its library says what it is.

fn main() -> std::process::ExitCode {
    ptztrack::main()
}
