//! hysteron-report
