// SPDX-License-Identifier: MPL-2.0

/// Why a `GstStructure` could not be read as one of the contract's types.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ContractError {
    /// The structure is of another kind.
    #[error("expected a structure named `{expected}`, found `{found}`")]
    WrongName {
        /// The name that was looked for.
        expected: &'static str,
        /// The name that stood there.
        found: String,
    },
    /// A field is missing, or holds another type.
    #[error("`{structure}`: field `{field}` is missing or has another type: {reason}")]
    Field {
        /// The structure's name.
        structure: String,
        /// The field's name.
        field: String,
        /// What GStreamer said of it.
        reason: String,
    },
    /// A field holds a value outside what it may hold.
    #[error("`{structure}`: field `{field}` has an invalid value: `{value}`")]
    Value {
        /// The structure's name.
        structure: String,
        /// The field's name.
        field: String,
        /// The value found.
        value: String,
    },
}
