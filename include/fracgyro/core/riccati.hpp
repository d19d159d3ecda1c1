// Gains of stationary Kalman filters and linear-quadratic regulators: the discrete algebraic Riccati equation
//
//        X = Aᵀ X (I + G X)⁻¹ A + H,        G = B R⁻¹ Bᵀ
//
//    by structure-preserving doubling (Chu, Fan, Lin, Wang, "Structure-preserving algorithms for periodic discrete-time
//    algebraic Riccati equations", 2004): with W = I + G H, repeat
//
//        A <- A W⁻¹ A        G <- G + A W⁻¹ G Aᵀ        H <- H + Aᵀ H W⁻¹ A
//
//    H grows to X and the error is squared at each repetition. With R near 0, G is large and digits are lost, which two
//    steps of Newton's method restore. Only sums, products and quotients: the same bits everywhere.
//
//    u = -K x with K = (R + Bᵀ X B)⁻¹ Bᵀ X A has the least sum of xᵀ H x + uᵀ R u. A filter of the measurements C x
//    with noise R and process noise H has Aᵀ and Cᵀ for A and B, X is the covariance of its prediction, and its gain X
//    Cᵀ (C X Cᵀ + R)⁻¹.
#pragma once

#include "fracgyro/core/expm.hpp"

namespace fracgyro {

// The first rows and columns of a square matrix, for sizes known only at run time.
template <std::size_t Room>
struct LeadingMatrix {
    Matrix<Room> entries{};
    std::size_t size = 0;

    std::array<double, Room>& operator[](std::size_t row) { return entries[row]; }
    const std::array<double, Room>& operator[](std::size_t row) const { return entries[row]; }

    static LeadingMatrix identity(std::size_t size) {
        LeadingMatrix m{.size = size};
        for (std::size_t i = 0; i < size; ++i) {
            m[i][i] = 1.0;
        }
        return m;
    }
    LeadingMatrix transposed() const {
        LeadingMatrix m{.size = size};
        for (std::size_t i = 0; i < size; ++i) {
            for (std::size_t j = 0; j < size; ++j) {
                m[i][j] = entries[j][i];
            }
        }
        return m;
    }
    friend LeadingMatrix operator*(const LeadingMatrix& l, const LeadingMatrix& r) {
        LeadingMatrix m{.size = l.size};
        for (std::size_t i = 0; i < l.size; ++i) {
            for (std::size_t n = 0; n < l.size; ++n) {
                const double factor = l[i][n];
                for (std::size_t j = 0; j < l.size; ++j) {
                    m[i][j] += factor * r[n][j];
                }
            }
        }
        return m;
    }
    friend LeadingMatrix operator+(const LeadingMatrix& l, const LeadingMatrix& r) {
        LeadingMatrix m = l;
        for (std::size_t i = 0; i < l.size; ++i) {
            for (std::size_t j = 0; j < l.size; ++j) {
                m[i][j] += r[i][j];
            }
        }
        return m;
    }
};

// Replaces the columns of `right` by the solutions x of a x = column: elimination with partial pivoting.
template <std::size_t Room, std::size_t Columns>
void solve(LeadingMatrix<Room> a, std::array<std::array<double, Columns>, Room>& right) {
    for (std::size_t i = 0; i < a.size; ++i) {
        std::size_t pivot = i;
        for (std::size_t k = i + 1; k < a.size; ++k) {
            pivot = absolute(a[k][i]) > absolute(a[pivot][i]) ? k : pivot;
        }
        const auto row = a[i];
        a[i] = a[pivot];
        a[pivot] = row;
        const auto known = right[i];
        right[i] = right[pivot];
        right[pivot] = known;
        for (std::size_t k = i + 1; k < a.size; ++k) {
            const double factor = a[k][i] / a[i][i];
            for (std::size_t j = i + 1; j < a.size; ++j) {
                a[k][j] -= factor * a[i][j];
            }
            for (std::size_t j = 0; j < Columns; ++j) {
                right[k][j] -= factor * right[i][j];
            }
        }
    }
    for (std::size_t i = a.size; i-- > 0;) {
        for (std::size_t j = 0; j < Columns; ++j) {
            for (std::size_t k = i + 1; k < a.size; ++k) {
                right[i][j] -= a[i][k] * right[k][j];
            }
            right[i][j] = right[i][j] / a[i][i];
        }
    }
}

// A row for each state, a column for each input (B), or for each measurement (Cᵀ).
template <std::size_t Rows, std::size_t Columns>
using Table = std::array<std::array<double, Columns>, Rows>;

// (R + Bᵀ X B)⁻¹ Bᵀ X, with a row for each input.
template <std::size_t Room, std::size_t Inputs>
Table<Inputs, Room> riccati_gain(const LeadingMatrix<Room>& x, const Table<Room, Inputs>& b,
                                 const std::array<double, Inputs>& r) {
    Table<Inputs, Room> gain{};
    LeadingMatrix<Inputs> sum{.size = Inputs};
    for (std::size_t k = 0; k < Inputs; ++k) {
        for (std::size_t j = 0; j < x.size; ++j) {
            for (std::size_t i = 0; i < x.size; ++i) {
                gain[k][j] += b[i][k] * x[i][j];
            }
        }
        for (std::size_t l = 0; l < Inputs; ++l) {
            sum[k][l] = k == l ? r[k] : 0.0;
            for (std::size_t j = 0; j < x.size; ++j) {
                sum[k][l] += gain[k][j] * b[j][l];
            }
        }
    }
    solve(sum, gain);
    return gain;
}

namespace detail {

inline constexpr int doublings = 60;  // for 2^60 steps
inline constexpr double rounding = 1e-15;

// Newton's method for the Riccati equation (Kleinman 1968): X of the loop that is closed by the gain of `x`,
// X = (A - B K)ᵀ X (A - B K) + H + Kᵀ R K, by doubling.
template <std::size_t Room, std::size_t Inputs>
LeadingMatrix<Room> newton_step(LeadingMatrix<Room> a, const Table<Room, Inputs>& b, LeadingMatrix<Room> sum,
                                const std::array<double, Inputs>& r, const LeadingMatrix<Room>& x) {
    const Table<Inputs, Room> gain = riccati_gain(x, b, r);
    Table<Inputs, Room> k{};
    for (std::size_t l = 0; l < Inputs; ++l) {
        for (std::size_t i = 0; i < a.size; ++i) {
            for (std::size_t j = 0; j < a.size; ++j) {
                k[l][j] += gain[l][i] * a[i][j];
            }
        }
    }
    for (std::size_t l = 0; l < Inputs; ++l) {
        for (std::size_t i = 0; i < a.size; ++i) {
            for (std::size_t j = 0; j < a.size; ++j) {
                a[i][j] -= b[i][l] * k[l][j];
                sum[i][j] += k[l][i] * r[l] * k[l][j];
            }
        }
    }
    double change = 1.0, size = 0.0;
    for (int n = 0; n < doublings && change > rounding * size; ++n) {
        const LeadingMatrix<Room> growth = a.transposed() * (sum * a);
        change = size = 0.0;
        for (std::size_t i = 0; i < a.size; ++i) {
            for (std::size_t j = 0; j <= i; ++j) {
                sum[i][j] = sum[j][i] = sum[i][j] + 0.5 * (growth[i][j] + growth[j][i]);
            }
            change = maximum(change, absolute(growth[i][i]));
            size = maximum(size, absolute(sum[i][i]));
        }
        a = a * a;
    }
    return sum;
}

}  // namespace detail

// X for A, B, H and the diagonal of R > 0, if they have a stabilizing solution.
template <std::size_t Room, std::size_t Inputs>
LeadingMatrix<Room> riccati(LeadingMatrix<Room> a, const Table<Room, Inputs>& b, LeadingMatrix<Room> h,
                            const std::array<double, Inputs>& r) {
    LeadingMatrix<Room> g{.size = a.size};
    for (std::size_t i = 0; i < a.size; ++i) {
        for (std::size_t j = 0; j < a.size; ++j) {
            for (std::size_t k = 0; k < Inputs; ++k) {
                g[i][j] += b[i][k] * b[j][k] / r[k];
            }
        }
    }
    const LeadingMatrix<Room> once = a, weight = h;
    double change = 1.0, size = 0.0;
    for (int n = 0; n < detail::doublings && change > detail::rounding * size; ++n) {
        const LeadingMatrix<Room> w = LeadingMatrix<Room>::identity(a.size) + g * h;
        LeadingMatrix<Room> of_a = a, of_g = g;  // W⁻¹ A, W⁻¹ G
        solve(w, of_a.entries);
        solve(w, of_g.entries);
        const LeadingMatrix<Room> back = a.transposed(), growth = back * (h * of_a);
        g = g + a * (of_g * back);
        a = a * of_a;
        change = 0.0;
        for (std::size_t i = 0; i < a.size; ++i) {
            for (std::size_t j = 0; j <= i; ++j) {  // symmetric in spite of rounding
                h[i][j] = h[j][i] = h[i][j] + 0.5 * (growth[i][j] + growth[j][i]);
                g[i][j] = g[j][i] = 0.5 * (g[i][j] + g[j][i]);
            }
            change = maximum(change, absolute(growth[i][i]));
            size = maximum(size, absolute(h[i][i]));
        }
    }
    for (int n = 0; n < 2; ++n) {
        h = detail::newton_step(once, b, weight, r, h);
    }
    return h;
}

}  // namespace fracgyro
