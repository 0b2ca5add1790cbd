//! Prints figures.

use cortex_m_semihosting::hprintln;

/// Prints the mean of several figures, the least and the most.
pub fn row(name: &str, figures: &[u32]) {
    let count = figures.len() as u32;
    let mean = (figures.iter().sum::<u32>() + count / 2) / count;
    let (least, most) =
        figures.iter().fold((u32::MAX, 0), |(least, most), x| (least.min(*x), most.max(*x)));
    hprintln!("row {} {} {} {}", name, mean, least, most);
}
