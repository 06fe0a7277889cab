//! Scenarios, metrics, studies and reports.
