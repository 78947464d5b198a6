use rc10_can::CanFrame;

/// A command that contains a NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the {field} is not a number")]
pub struct NotANumber {
    /// Name of the value that is not a number.
    pub field: &'static str,
    /// A frame that may be sent in its place and moves nothing; see the command's `pack`.
    pub neutral: CanFrame,
}
