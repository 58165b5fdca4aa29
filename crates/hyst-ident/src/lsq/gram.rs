//! Normal equations: of all rows during a fit, and per block after convergence.
//!
//! With the matrices `XᵀX` of all blocks, a fit to any union of blocks
//! and its error on the others take no further pass over the record. This makes cross-validation and block-wise
//! standard errors cheap.

use std::borrow::Cow;

use nalgebra::{DMatrix, DMatrixView, DVector};

/// Columns of a strip of [`own_products`].
const STRIP: usize = 48;

/// Minimum number of rows of a product. Fewer rows cost little more: most of the time goes into the products.
const MIN_ROWS: usize = 256;

/// Additional rows of a buffer: columns that are a power of two apart would share a few lines of the cache.
const PADDING: usize = 8;

/// Adds `XᵀX` to the upper triangle, strip by strip: half the work of a general product.
fn add_products(upper: &mut DMatrix<f64>, x: DMatrixView<'_, f64>) {
    let n = x.ncols();
    for first in (0..n).step_by(STRIP) {
        let width = STRIP.min(n - first);
        let strip = x.columns(first, width).transpose();
        let rest = n - first;
        upper.view_mut((first, first), (width, rest)).gemm(1.0, &strip, &x.columns(first, rest), 1.0);
    }
}

/// Returns `XᵀX`.
fn own_products(x: &DMatrix<f64>) -> DMatrix<f64> {
    let mut products = DMatrix::zeros(x.ncols(), x.ncols());
    add_products(&mut products, x.as_view());
    products.fill_lower_triangle_with_upper_triangle();
    products
}

/// `XᵀX` of a set of rows; the target is the last column of X.
#[derive(Clone, Debug)]
pub(crate) struct Gram {
    pub(crate) matrix: DMatrix<f64>,
    pub(crate) rows: usize,
}

impl Gram {
    pub(crate) fn zeros(columns: usize) -> Self {
        Self { matrix: DMatrix::zeros(columns, columns), rows: 0 }
    }

    /// Returns the normal equations of these rows.
    pub(crate) fn of(rows: &DMatrix<f64>) -> Self {
        Self { matrix: own_products(rows), rows: rows.nrows() }
    }

    /// Returns the normal equations of all blocks of rows, each `columns` wide.
    pub(crate) fn of_all(blocks: &[DMatrix<f64>], columns: usize) -> Self {
        Self::of_each(blocks.iter(), columns)
    }

    /// Returns the same for blocks one by one. Short blocks are joined.
    fn of_each<'a>(blocks: impl Iterator<Item = &'a DMatrix<f64>>, columns: usize) -> Self {
        let mut total = Self::zeros(columns);
        let mut joined = DMatrix::zeros(2 * MIN_ROWS + PADDING, columns);
        let mut held = 0;
        for block in blocks {
            total.rows += block.nrows();
            if block.nrows() >= MIN_ROWS {
                add_products(&mut total.matrix, block.as_view());
                continue;
            }
            joined.rows_mut(held, block.nrows()).copy_from(block);
            held += block.nrows();
            if held >= MIN_ROWS {
                add_products(&mut total.matrix, joined.rows(0, held).as_view());
                held = 0;
            }
        }
        if held > 0 {
            add_products(&mut total.matrix, joined.rows(0, held).as_view());
        }
        total.matrix.fill_lower_triangle_with_upper_triangle();
        total
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.matrix += &other.matrix;
        self.rows += other.rows;
    }

    pub(crate) fn sum<'a>(columns: usize, parts: impl Iterator<Item = &'a Self>) -> Self {
        let mut total = Self::zeros(columns);
        parts.for_each(|p| total.add(p));
        total
    }

    /// Returns the number of unknowns: all columns but the target.
    pub(crate) fn unknowns(&self) -> usize {
        self.matrix.ncols() - 1
    }

    /// Returns Σ (y − X z)² over the rows.
    pub(crate) fn error(&self, z: &DVector<f64>) -> f64 {
        let n = self.unknowns();
        let mut full = z.clone().insert_row(n, -1.0);
        full.neg_mut();
        (full.transpose() * &self.matrix * &full)[(0, 0)].max(0.0)
    }

    /// Returns Xᵀ(y − X z): the gradient that these rows contribute.
    pub(crate) fn score(&self, z: &DVector<f64>) -> DVector<f64> {
        let n = self.unknowns();
        self.matrix.view((0, n), (n, 1)).column(0) - self.matrix.view((0, 0), (n, n)) * z
    }
}

/// Contribution of a block to the normal equations: its rows, or their products if those are fewer numbers.
///
/// With 25 rows and 250 columns, a block's rows take a tenth of the memory of its products. A diagnosis holds several
/// dozen fits of a hundred blocks.
#[derive(Clone, Debug)]
pub(crate) enum Share {
    /// The target is the last column.
    Rows(DMatrix<f64>),
    Products(Gram),
}

impl Share {
    /// Stores these rows.
    pub(crate) fn of(rows: DMatrix<f64>) -> Self {
        if rows.nrows() < rows.ncols() { Self::Rows(rows) } else { Self::Products(Gram::of(&rows)) }
    }

    pub(crate) fn columns(&self) -> usize {
        match self {
            Self::Rows(rows) => rows.ncols(),
            Self::Products(gram) => gram.matrix.ncols(),
        }
    }

    pub(crate) fn rows(&self) -> usize {
        match self {
            Self::Rows(rows) => rows.nrows(),
            Self::Products(gram) => gram.rows,
        }
    }

    /// Returns the products `XᵀX`.
    pub(crate) fn gram(&self) -> Cow<'_, Gram> {
        match self {
            Self::Rows(rows) => Cow::Owned(Gram::of(rows)),
            Self::Products(gram) => Cow::Borrowed(gram),
        }
    }

    /// Returns the sum of the products, which are `columns` wide.
    pub(crate) fn sum<'a>(columns: usize, shares: impl Iterator<Item = &'a Self>) -> Gram {
        let (mut blocks, mut products) = (Vec::new(), Vec::new());
        for share in shares {
            match share {
                Self::Rows(rows) => blocks.push(rows),
                Self::Products(gram) => products.push(gram),
            }
        }
        let mut total = Gram::of_each(blocks.into_iter(), columns);
        products.into_iter().for_each(|gram| total.add(gram));
        total
    }

    /// Returns Σ (y − X z)² over the rows.
    pub(crate) fn error(&self, z: &DVector<f64>) -> f64 {
        match self {
            Self::Rows(rows) => residual(rows, z).norm_squared(),
            Self::Products(gram) => gram.error(z),
        }
    }

    /// Returns Xᵀ(y − X z): the gradient that these rows contribute.
    pub(crate) fn score(&self, z: &DVector<f64>) -> DVector<f64> {
        match self {
            Self::Rows(rows) => rows.columns(0, z.len()).tr_mul(&residual(rows, z)),
            Self::Products(gram) => gram.score(z),
        }
    }
}

/// Returns y − X z, where y is the last column.
fn residual(rows: &DMatrix<f64>, z: &DVector<f64>) -> DVector<f64> {
    rows.column(z.len()) - rows.columns(0, z.len()) * z
}

/// Contribution of further columns to given normal equations: their products with the given columns and with each
/// other.
#[derive(Clone, Debug)]
pub(crate) struct Bordered {
    cross: DMatrix<f64>,
    own: DMatrix<f64>,
}

impl Bordered {
    /// Returns zero products for `further` columns added to `columns`.
    pub(crate) fn zeros(columns: usize, further: usize) -> Self {
        Self { cross: DMatrix::zeros(columns, further), own: DMatrix::zeros(further, further) }
    }

    /// Adds rows of the given and of the further columns.
    pub(crate) fn add(&mut self, x: &DMatrix<f64>, further: &DMatrix<f64>) {
        // Transposing the few columns costs less than transposing the many.
        self.cross += (further.transpose() * x).transpose();
        self.own += own_products(further);
    }

    /// Returns the normal equations of all columns: the given columns keep their positions, the target moves behind the
    /// further ones.
    pub(crate) fn around(&self, gram: &Gram) -> Gram {
        let (n, q) = self.cross.shape();
        let target = n - 1 + q;
        let old = |i: usize| match i {
            i if i < n - 1 => Some(i),
            i if i == target => Some(n - 1),
            _ => None,
        };
        let matrix = DMatrix::from_fn(n + q, n + q, |r, c| match (old(r), old(c)) {
            (Some(r), Some(c)) => gram.matrix[(r, c)],
            (Some(r), None) => self.cross[(r, c - (n - 1))],
            (None, Some(c)) => self.cross[(c, r - (n - 1))],
            (None, None) => self.own[(r - (n - 1), c - (n - 1))],
        });
        Gram { matrix, rows: gram.rows }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use super::*;

    #[test]
    fn products_by_strips_equal_the_full_product() {
        let x = DMatrix::from_fn(70, 2 * STRIP + 5, |k, c| ((c + 2) as f64 * 0.3 * k as f64).cos());
        assert!((own_products(&x) - x.transpose() * &x).amax() < 1e-12);
    }

    #[test]
    fn blocks_of_any_length_add_up() {
        let x = DMatrix::from_fn(3 * MIN_ROWS, 7, |k, c| ((c + 2) as f64 * 0.3 * k as f64).cos());
        for lengths in [vec![MIN_ROWS - 1, 1, MIN_ROWS + 5, 0, 3], vec![2], vec![]] {
            let starts = lengths.iter().scan(0, |next, n| Some(std::mem::replace(next, *next + n)));
            let blocks: Vec<DMatrix<f64>> =
                starts.zip(&lengths).map(|(start, n)| x.rows(start, *n).into_owned()).collect();
            let (all, found) = (x.rows(0, lengths.iter().sum()), Gram::of_all(&blocks, 7));
            assert_eq!(found.rows, all.nrows());
            assert!((found.matrix - all.transpose() * all).amax() < 1e-10);
        }
    }

    #[test]
    fn rows_and_products_give_equal_results() {
        let x = DMatrix::from_fn(9, 12, |k, c| ((c + 2) as f64 * 0.3 * k as f64).cos());
        let z = DVector::from_fn(11, |i, _| (i as f64).sin());
        let (rows, products) = (Share::of(x.clone()), Share::Products(Gram::of(&x)));
        assert!(matches!(rows, Share::Rows(_)) && matches!(Share::of(x.rows(0, 9).transpose()), Share::Products(_)));
        assert_eq!((rows.columns(), rows.rows()), (products.columns(), products.rows()));
        assert_eq!(rows.gram().matrix, products.gram().matrix);
        assert!((rows.error(&z) - products.error(&z)).abs() < 1e-12 * products.error(&z));
        assert!((rows.score(&z) - products.score(&z)).amax() < 1e-12);
    }

    #[test]
    fn further_columns_are_inserted_before_the_target() {
        let of = |columns: &[usize], rows: Range<usize>| {
            let at = |k: usize, c: usize| ((c + 2) as f64 * 0.3 * (k + rows.start) as f64).cos();
            DMatrix::from_fn(rows.len(), columns.len(), |k, c| at(k, columns[c]))
        };
        let (old, further, all) = ([0, 1, 4], [2, 3], [0, 1, 2, 3, 4]);
        let mut bordered = Bordered::zeros(3, 2);
        let blocks = [0..7, 7..20];
        blocks.iter().for_each(|rows| bordered.add(&of(&old, rows.clone()), &of(&further, rows.clone())));
        let old: Vec<DMatrix<f64>> = blocks.iter().map(|rows| of(&old, rows.clone())).collect();
        let whole = bordered.around(&Gram::of_all(&old, 3));
        assert_eq!(whole.rows, 20);
        assert!((whole.matrix - Gram::of(&of(&all, 0..20)).matrix).amax() < 1e-12);
    }
}
