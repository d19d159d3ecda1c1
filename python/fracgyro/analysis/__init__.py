"""What the paper, the rate sensor and studies share: metrics, intervals, pictures, pages."""
