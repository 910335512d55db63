"""Other shapes of one robot on one mesh: free form and morphing, with the connectivity kept."""
