//! hysteron-identify
