//! hysteron-plant
