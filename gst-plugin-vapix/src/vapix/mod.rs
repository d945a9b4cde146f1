//! The camera's HTTP client.
