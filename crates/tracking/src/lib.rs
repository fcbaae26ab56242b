//! hysteron-tracking
