//! The test programs of the CAN check and the marks in their output.

/// Packages and names of the tests in the machine.
pub(super) const TESTS: &[(&str, &str)] = &[("hyst-hw", "can"), ("hyst-tests", "cli_can")];
/// Start of the line that the init script prints after a passed test.
pub(super) const PASSED: &str = "hyst-can: passed ";
