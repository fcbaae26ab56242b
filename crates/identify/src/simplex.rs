//! Nelder and Mead's simplex (Computer Journal 7, 1965) in any number of variables.

use crate::family::range;

/// A corner of the simplex, and the value there.
pub type Vertex = (Vec<f64>, f64);

/// The least value found from `start`, in a simplex of `size` in every direction, and where: after at most `steps` steps for each
/// variable, or when the corners are `enough`.
///
/// # Cost
/// One or two evaluations a step; one for each variable where the simplex shrinks.
/// # Example
/// ```
/// let (x, _) = hysteron_identify::simplex::minimum(&[0.0], 0.5, 60, |_| false, |x| (x[0] - 3.0).powi(2));
/// assert!((x[0] - 3.0).abs() < 1e-6);
/// ```
pub fn minimum(
    start: &[f64],
    size: f64,
    steps: usize,
    enough: impl Fn(&[Vertex]) -> bool,
    f: impl Fn(&[f64]) -> f64,
) -> Vertex {
    let n = start.len();
    let vertex = |x: Vec<f64>| {
        let value = f(&x);
        (x, value)
    };
    let mut vertices = vec![vertex(start.to_vec())];
    for i in 0..n {
        let mut x = start.to_vec();
        x[i] += size;
        vertices.push(vertex(x));
    }
    for _ in 0..steps * n {
        if enough(&vertices) {
            break;
        }
        vertices.sort_by(|a, b| a.1.total_cmp(&b.1));
        let middle: Vec<f64> = (0..n)
            .map(|i| vertices[..n].iter().map(|v| v.0[i]).sum::<f64>() / n as f64)
            .collect();
        let worst = vertices[n].0.clone();
        let along = |t: f64| vertex(middle.iter().zip(&worst).map(|(m, w)| m + t * (w - m)).collect());
        let reflected = along(-1.0);
        if reflected.1 < vertices[0].1 {
            let expanded = along(-2.0);
            vertices[n] = if expanded.1 < reflected.1 { expanded } else { reflected };
        } else if reflected.1 < vertices[n - 1].1 {
            vertices[n] = reflected;
        } else {
            let contracted = along(if reflected.1 < vertices[n].1 { -0.5 } else { 0.5 });
            if contracted.1 < vertices[n].1.min(reflected.1) {
                vertices[n] = contracted;
            } else {
                let best = vertices[0].0.clone();
                for v in &mut vertices[1..] {
                    *v = vertex(v.0.iter().zip(&best).map(|(x, b)| 0.5 * (x + b)).collect());
                }
            }
        }
    }
    vertices.sort_by(|a, b| a.1.total_cmp(&b.1));
    vertices.swap_remove(0)
}

/// Whether the values at the corners are the same within a millionth.
pub(crate) fn is_level(vertices: &[Vertex]) -> bool {
    let (low, high) = range(vertices.iter().map(|vertex| vertex.1));
    high - low <= 1e-6 * low.abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley, least at (1, 1), and a parabola of one variable.
    #[test]
    fn val_known_minima() {
        let (x, value) = minimum(&[-1.2, 1.0], 0.5, 200, is_level, |x| {
            100.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2)
        });
        assert!(value < 1e-6 && (x[0] - 1.0).abs() < 1e-2, "{x:?} {value}");
        let (x, value) = minimum(
            &[-1.2, 1.0],
            0.2,
            150,
            |_| false,
            |x| (1.0 - x[0]).powi(2) + 100.0 * (x[1] - x[0] * x[0]).powi(2),
        );
        assert!(value < 1e-10, "{x:?} {value}");
        let (x, _) = minimum(&[0.0], 0.5, 60, is_level, |x| 1.0 + (x[0] - 3.0).powi(2));
        assert!((x[0] - 3.0).abs() < 1e-2, "{x:?}");
    }
}
