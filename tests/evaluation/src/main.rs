//! `evaluate`: runs tests and writes down what came out.

fn main() {}
